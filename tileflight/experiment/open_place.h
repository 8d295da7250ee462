#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/attribution.h"
#include "tileflight/tiles/load.h"
#include "tileflight/tiles/placement.h"
#include "tileflight/tiles/selection.h"
#include "tileflight/tiles/tileset_tree.h"

namespace tileflight::experiment {

/// A tile that could not be read, or a part of the tree that could not be followed.
struct MissingTile {
  std::string failure;
  std::optional<geometry::Box3> bounds;  ///< local frame; nullopt: not known
};

/// What was read of a cut.
struct PlacePart {
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame; none without triangles
  std::vector<geometry::PointCloud> clouds;
  std::vector<MissingTile> missing;
  std::int64_t tiles = 0;
  std::uintmax_t file_bytes = 0;
  std::uintmax_t memory_bytes = 0;  ///< of meshes, textures and points, with the trees that rays need
};

/// A place that is looked into part by part, each as finely as it is wanted, instead of being loaded whole.
class OpenPlace {
 public:
  /// `load`: where the local frame and the region are; no tile is read yet. Throws InputError, also where the source's
  /// terms forbid `use`.
  OpenPlace(const std::string& source, const tiles::LoadOptions& load, tiles::Use use);

  const std::string& name() const { return name_; }  ///< as it may be shown
  const tiles::Placement& placement() const { return placement_; }
  bool is_georeferenced() const { return is_georeferenced_; }
  const tiles::TilesetTree& tree() const { return tree_; }
  tiles::TileSource& source() { return *source_; }

  tiles::TileCut cut(const tiles::Wanted& wanted) { return tiles::select_cut(tree_, wanted); }
  /// Reads a cut; what is missing or broken is told, not thrown. nullopt: it takes more than `max_memory_bytes`.
  std::optional<PlacePart> read(const tiles::TileCut& cut, bool textures, std::uintmax_t max_memory_bytes,
                                const Progress& progress);

  /// Of all that was read so far.
  std::vector<std::string> attribution() const;
  std::vector<std::string> warnings() const;

 private:
  std::string name_;
  std::unique_ptr<tiles::TileSource> source_;
  tiles::TilesetTree tree_;
  tiles::Placement placement_;
  bool is_georeferenced_;
  tiles::Attribution copyrights_;
  std::vector<std::string> warnings_;
};

/// Everything that both want.
tiles::Wanted wanted_within(tiles::Wanted wanted, const geometry::Box3& box, const geometry::SE3& T_local_tileset);

/// A source's name for a title: the last part of its path, or of the folder that its tileset.json lies in.
std::string short_name(const std::string& source);

}  // namespace tileflight::experiment
