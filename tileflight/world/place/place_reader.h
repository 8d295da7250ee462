#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/tile_content/attribution.h"
#include "tileflight/tiles/tileset/content_records.h"
#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/placement.h"
#include "tileflight/tiles/tileset/selection.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::place {

/// Throws InputError that names the source if there is no triangle to see; `has_points`: there are points instead (the
/// message says so); `failures`: the tiles that could not be read, if any, which are then the cause.
void require_surface(const std::vector<imaging::TexturedMesh>& meshes, bool has_points, const std::string& source,
                     const std::vector<std::string>& failures = {});

/// If there are no meshes, returns a degenerate triangle, which no ray hits: ray casting needs a scene that is not
/// empty.
std::vector<imaging::TexturedMesh> with_placeholder(std::vector<imaging::TexturedMesh> meshes);

/// A tile that could not be read, or a subtree that could not be followed.
struct MissingTile {
  std::string failure;
  std::optional<geometry::Box3> bounds;  ///< local frame; nullopt: unknown
};

/// Content of a cut through the tile tree.
struct PlacePart {
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame; empty if there are no triangles
  std::vector<geometry::PointCloud> clouds;
  std::vector<MissingTile> missing;
  std::int64_t tiles = 0;
  std::uintmax_t file_bytes = 0;
  std::uintmax_t memory_bytes = 0;  ///< of meshes, textures, points and ray tracing structures
};

/// Reads a place part by part, each at the required resolution, instead of loading it whole.
class PlaceReader {
 public:
  /// Opens the source; no tile is read yet. `load`: the local frame and the region. Throws InputError, also if the
  /// source's terms forbid `use`.
  PlaceReader(const std::string& source, const tileset::LoadOptions& load, fetch::Use use);

  const std::string& name() const { return name_; }  ///< in the form in which it may be displayed
  const tileset::Placement& placement() const { return placement_; }
  bool is_georeferenced() const { return is_georeferenced_; }
  const tileset::TilesetTree& tree() const { return tree_; }
  fetch::TileSource& source() { return *source_; }

  tileset::TileCut select_cut(const tileset::RefinementCriterion& criterion) {
    return tileset::select_cut(tree_, criterion);
  }
  /// Reads a cut; missing or broken tiles are reported in the result, not thrown. nullopt: it exceeds
  /// `max_memory_bytes`.
  std::optional<PlacePart> read(const tileset::TileCut& cut, bool textures, std::uintmax_t max_memory_bytes,
                                const Progress& progress);

  /// Widens the volumes by which tiles are selected to what these contents hold (tileset::widen_to_contents); tells
  /// whether that changed them.
  bool widen_to_contents(const std::vector<tileset::CutContent>& contents);
  /// Tells whether the surfaces of a cut's contents lack textures (tileset::lacks_textures).
  bool lacks_textures(const std::vector<tileset::CutContent>& contents);

  /// Attribution of everything read so far.
  std::vector<std::string> attribution() const;
  std::vector<std::string> warnings() const;
  /// Returns why tiles could not be read so far, each once, in alphabetic order.
  const std::set<std::string>& failures() const { return failures_; }

 private:
  std::string name_;
  std::unique_ptr<fetch::TileSource> source_;
  tileset::TilesetTree tree_;
  tileset::Placement placement_;
  bool is_georeferenced_;
  tile_content::AttributionCollector copyrights_;
  std::vector<std::string> warnings_;
  std::set<std::string> failures_;
  tileset::StrayContents stray_;
};

/// Returns the combination of the criterion and the box.
tileset::RefinementCriterion restrict_to_box(tileset::RefinementCriterion criterion, const geometry::Box3& box,
                                             const geometry::SE3& T_local_tileset);

/// Returns a source's name for titles: the last part of its path, or of the folder of its tileset.json.
std::string source_display_name(const std::string& source);

}  // namespace tileflight::place
