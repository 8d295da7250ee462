#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/tileset/cut_reader.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::preview {

using ContentIds = std::vector<std::uint32_t>;  ///< content indices, ascending

/// Summary of one content.
struct ContentFacts {
  std::int64_t bytes = 0;            ///< of its file
  std::int64_t decoded_bytes = 0;    ///< positions, texture coordinates, colours, triangles, texels
  std::uintmax_t working_bytes = 0;  ///< the same with structures for ray tracing
  geometry::Box3 bounds;             ///< of its surface, local frame; empty: no triangle
  bool has_points = false;
};

/// Reads and keeps the contents of several cuts. They are decoded when needed: as many as fit into the memory limit are
/// kept, the others are read again. Not thread safe.
class CoverageContents {
 public:
  /// `source` and `tree` must outlive it.
  CoverageContents(fetch::TileSource& source, tileset::TilesetTree& tree, const geometry::SE3& T_local_tileset,
                   std::uintmax_t max_memory_bytes);

  /// Adds a cut's contents; returns their indices.
  ContentIds add(const tileset::TileCut& cut);
  /// Reads each content and passes it to `visit`, in ascending order. Throws InputError for an unreadable content
  /// unless incomplete sets are allowed (its facts are then empty), and MemoryLimitExceeded for one that is too large.
  void read_all(bool allow_incomplete,
                const std::function<void(std::uint32_t id, const tileset::LoadedContent& content)>& visit,
                const Progress& progress);

  std::size_t size() const { return all_.contents.size(); }
  const tileset::CutContent& operator[](std::size_t id) const { return all_.contents[id]; }
  const ContentFacts& facts(std::size_t id) const { return facts_[id]; }
  std::uintmax_t max_memory_bytes() const { return max_memory_bytes_; }
  /// Sets how much of the memory limit is used elsewhere and not available for keeping contents.
  void reserve(std::uintmax_t bytes);

  /// Divides contents, in order, into groups of which each fits into memory as a scene.
  std::vector<ContentIds> scene_groups(const ContentIds& ids) const;
  /// Meshes with triangles, and for each its content.
  struct OwnedMeshes {
    std::vector<imaging::TexturedMesh> meshes;
    std::vector<std::uint32_t> content_of_mesh;
  };
  OwnedMeshes meshes(const ContentIds& ids, bool textures);
  /// Returns the bounds of the surfaces.
  geometry::Box3 bounds(const ContentIds& ids) const;

 private:
  std::vector<tileset::LoadedContent> read(const ContentIds& ids, bool textures, std::uintmax_t max_bytes);
  void record(std::uint32_t id, tileset::LoadedContent content);

  fetch::TileSource& source_;
  tileset::TilesetTree& tree_;
  geometry::SE3 T_local_tileset_;
  std::uintmax_t max_memory_bytes_;
  std::map<std::pair<tileset::NodeId, std::size_t>, std::uint32_t> id_of_;
  tileset::TileCut all_;
  std::vector<ContentFacts> facts_;
  std::vector<std::optional<tileset::LoadedContent>> kept_;
  std::uintmax_t kept_bytes_ = 0;
  std::uintmax_t kept_limit_bytes_;
};

}  // namespace tileflight::preview
