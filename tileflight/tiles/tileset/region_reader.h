#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/content_records.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {

/// Returns the criterion of a request: its region, or what its flight sees.
RefinementCriterion request_criterion(const Placement& placement, const LoadOptions& options);

/// Throws InputError, with the cause and the remedy, if the cut of a request holds nothing.
void require_contents(const TileCut& cut, const TilesetTree& tree, const Placement& placement,
                      const LoadOptions& options, const std::string& name);

/// Reads a region of a tileset in parts, so that memory depends on the part and not on the region. The cut is selected
/// once. Not thread safe.
class RegionReader {
 public:
  /// Opens the tileset, resolves the region and selects its cut. `source` must outlive the reader; `name` is used in
  /// messages. Throws InputError like load_region().
  RegionReader(fetch::TileSource& source, std::string name, const LoadOptions& options, const Progress& progress = {});
  RegionReader(const RegionReader&) = delete;
  RegionReader& operator=(const RegionReader&) = delete;

  const Placement& placement() const { return placement_; }
  std::size_t content_count() const { return cut_.contents.size(); }

  /// Estimates how many of the contents count: those whose volume reaches into the region, and of those above and below
  /// the share that was found to hold something in it.
  double estimated_count() const;

  /// Returns the contents, in the cut's order, that may reach into a box of the local frame: by their bounding volumes
  /// or, once they are read, by what they hold. Volumes often state wrong heights, so all contents above or below the
  /// region belong to the cut; those that turn out to hold nothing in the region are not counted (summary()).
  std::vector<std::size_t> contents_in(const geometry::Box3& box) const;
  /// Reads what is needed to know the region before it is divided: the bounds of all contents if the request leaves its
  /// extent or its heights to the tileset. They end where the surface ends, and not where the volumes do. Otherwise,
  /// and of contents that were read, reads nothing; read() extends the region likewise.
  void settle_region(const Progress& progress = {});
  /// Returns all contents of the cut.
  std::vector<std::size_t> all_contents() const;
  /// Returns the size of the cut's distinct files; nullopt if the source does not know it.
  std::optional<std::uintmax_t> file_bytes() const;

  /// Reads these contents, in this order, without those that are left out (is_left_out). A content may be read again.
  /// Throws MemoryLimitExceeded, and InputError for the first unreadable content unless options.allow_incomplete.
  std::vector<LoadedContent> read(const std::vector<std::size_t>& contents, const Progress& progress = {});

  /// Returns the record of a content; nullopt if it was not read.
  const std::optional<ContentRecord>& found(std::size_t content) const { return records_[content]; }
  /// Whether a content that was read is left out: it is unreadable, or neither its volume nor what it holds reaches
  /// into the region.
  bool is_left_out(std::size_t content) const { return !records_[content]->failure.empty() || !reaches_in(content); }
  /// Takes over the record of a content that another process has read.
  void learn(std::size_t content, const ContentRecord& record);
  /// Counts a file that another process has read.
  void count_file(const fetch::CountedFile& file) { counted_.count(file); }
  /// Returns the files that were read for the first time since the last call.
  std::vector<fetch::CountedFile> take_new_files() { return counted_.take_new_files(); }
  /// Returns the hash of the cut: equal cuts have equal hashes.
  const std::string& cut_hash() const { return cut_.hash; }

  /// Returns the result of load_region() without meshes and clouds, for all contents read so far. Each counts once,
  /// however often it was read.
  LoadedTiles summary() const;

 private:
  void select();
  bool reaches_in(std::size_t content) const;
  void require_some_surface();
  bool is_open_region() const;
  void grow_region(const geometry::Box3& bounds);
  void learn_bounds(const std::vector<std::size_t>& contents, const Progress& progress);
  void record(std::size_t content, const LoadedContent& loaded);

  fetch::TileSource& source_;
  fetch::CountingSource counted_;
  std::string name_;
  LoadOptions options_;
  TilesetTree tree_;
  Placement placement_;
  TileCut cut_;
  std::vector<bool> is_outside_;             ///< of each content: its volume says that it holds nothing in the region
  std::vector<std::string> first_warnings_;  ///< warnings of the source before any content was read
  std::vector<geometry::Box3> bounds_;       ///< one for each content, local frame
  std::vector<std::optional<ContentRecord>> records_;
};

}  // namespace tileflight::tileset
