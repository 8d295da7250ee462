#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/jobs/build_folder.h"
#include "tileflight/tiles/tileset/region_reader.h"
#include "tileflight/world/ground_truth/quantization_floor.h"

namespace tileflight::place {

/// Record of a block whose files are all written.
struct BlockRecord {
  std::size_t triangles = 0, surface_points = 0, cloud_points = 0, voxels_occupied = 0;
  bool has_files = false;   ///< false: the block holds nothing and has no folder
  std::int32_t border = 1;  ///< cells around it that were read, too
  /// The contents read for it (indices of the region's cut), and what they hold.
  std::map<std::size_t, tileset::ContentRecord> contents;
  /// Files that the process had not read before.
  std::vector<fetch::CountedFile> files;
};

/// The finished blocks of an incomplete truth, stored beside its folder DIR/NAME (core/jobs/build_folder.h):
///   DIR/.NAME.blocks/truth/blocks/x00003_y00001/   files of a finished block; `truth` becomes the output
///                    done/x00003_y00001.json       its record, written last; .floor: its errors of a perfect map
///                    temporary/                    blocks in the making
/// Several processes (on machines that share the folder) may add blocks, also the same one.
class BlockStore {
 public:
  static std::filesystem::path folder_for(const std::filesystem::path& output);
  static bool exists(const std::filesystem::path& output);
  /// Prepares the store for a job, as BuildFolder::prepare() does.
  static std::string prepare(const std::filesystem::path& output, const nlohmann::json& inputs, jobs::Share share);

  /// Enters a prepared store under a name. Throws InputError.
  BlockStore(const std::filesystem::path& output, const std::string& name, jobs::Share share);

  const jobs::BuildFolder& folder() const { return folder_; }
  std::filesystem::path truth_folder() const { return folder_.path() / "truth"; }
  /// Runs `make`, which writes a block's files into the folder given and returns the block's record and its errors of a
  /// perfect map; then adds the block.
  void add(const std::string& block,
           const std::function<std::pair<BlockRecord, ground_truth::QuantizationFloor>(const std::filesystem::path&)>&
               make) const;
  /// Reads the record of a block; nullopt if the block is not finished.
  std::optional<BlockRecord> read(const std::string& block) const;
  bool holds(const std::string& block) const;
  void add_floor(const std::string& block, ground_truth::QuantizationFloor& floor) const;
  void remove() const { folder_.remove(); }

 private:
  std::filesystem::path record_of(const std::string& block) const {
    return folder_.path() / "done" / (block + ".json");
  }
  std::filesystem::path floor_of(const std::string& block) const {
    return folder_.path() / "done" / (block + ".floor");
  }
  std::filesystem::path temporary_for(const std::string& block) const;

  jobs::BuildFolder folder_;
};

}  // namespace tileflight::place
