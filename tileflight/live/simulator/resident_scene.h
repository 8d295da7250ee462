#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/capture/render/appearance.h"
#include "tileflight/capture/render/scene_objects.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/tiles/tileset/tileset_tree.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::simulator {

/// The meshes of a tile or of a whole region, prepared for rendering: tree for beams, appearance, bounds of objects.
/// The tree for rays is built by the first ray that meets the meshes. Immutable; shared by the scenes that hold it.
class ResidentPart {
 public:
  /// Bounds of the triangles of each feature of a mesh, or of those without one (kNoFeature), local frame.
  using FeatureBounds = std::map<std::uint32_t, geometry::Box3>;

  /// `meshes`: local frame. Throws InputError, std::runtime_error.
  ResidentPart(std::vector<imaging::TexturedMesh> meshes, const scene::SceneFrame& frame);

  const std::shared_ptr<const scene::ScenePart>& scene() const { return scene_; }
  const std::shared_ptr<const render::PartAppearance>& appearance() const { return appearance_; }
  /// For each mesh.
  const std::vector<FeatureBounds>& bounds() const { return bounds_; }
  std::uintmax_t bytes() const { return bytes_; }  ///< resident_bytes()

 private:
  std::shared_ptr<const scene::ScenePart> scene_;
  std::shared_ptr<const render::PartAppearance> appearance_;
  std::vector<FeatureBounds> bounds_;
  std::uintmax_t bytes_ = 0;
};

/// Identifies a content of the tree by its tile and its index among the tile's contents. (The identity in a cut is not
/// enough: an external tileset that several tiles refer to, each with its own transform, has the same one in each.)
using TileKey = std::pair<tileset::NodeId, std::size_t>;

/// A tile's content in a scene.
struct ResidentTile {
  std::optional<TileKey> key;  ///< nullopt: could not be read
  double geometric_error_m = 0.0;
  std::size_t mesh_count = 0;                ///< its meshes follow those of the tile before
  std::shared_ptr<const ResidentPart> part;  ///< its own; null in a scene of one part for all tiles
};

/// An object beside the tiles.
struct PlacedObject {
  std::string name;
  std::shared_ptr<const ResidentPart> part;
  Eigen::Affine3d pose;  ///< p_local = pose * p_part
};

/// A working set: the tiles in memory, prepared for ray casting and rendering. Immutable and shared by all users;
/// replaced by a new one when other tiles are needed.
class ResidentScene {
 public:
  /// A scene whose parts are those of the tiles. All have the frame given, the same for all scenes of a session, so
  /// that surfaces are bit-identical in each.
  ResidentScene(std::vector<ResidentTile> tiles, const scene::SceneFrame& frame, LoadedRegion loaded);
  /// A scene of one part that holds the meshes of all tiles.
  ResidentScene(std::vector<ResidentTile> tiles, std::shared_ptr<const ResidentPart> whole, LoadedRegion loaded);

  /// Combines the tiles of `place`, which has no objects beside them, with objects. `same`: a scene of the same place
  /// and objects in other poses, whose names and appearance are reused; may be null.
  ResidentScene(const ResidentScene& place, const std::vector<PlacedObject>& objects, const ResidentScene* same);

  const scene::Scene& scene() const { return scene_; }
  const std::shared_ptr<const render::Appearance>& appearance() const { return appearance_; }
  const render::SceneObjects& objects() const { return labels_->objects; }
  /// For each of objects().all(), the name under which clients know it (object_names.h).
  const std::vector<std::string>& object_names() const { return labels_->names; }
  /// For each of objects().all(), the bounds of all its triangles, local frame.
  const std::vector<geometry::Box3>& object_bounds() const { return object_bounds_; }
  /// Index of the first of objects().all() that is beside the tiles; from there on the order is that of
  /// scene().placed().
  std::uint32_t first_placed_object() const { return first_placed_object_; }
  /// Object names without duplicates, sorted.
  const std::vector<std::string>& distinct_names() const { return labels_->distinct; }
  /// Geometric error of the tile that a mesh of the scene belongs to.
  double geometric_error_m(std::uint32_t mesh) const { return tiles_[tile_of_mesh_[mesh]].geometric_error_m; }
  std::uint32_t tile_of_mesh(std::uint32_t mesh) const { return tile_of_mesh_[mesh]; }
  const std::vector<ResidentTile>& tiles() const { return tiles_; }
  const LoadedRegion& loaded() const { return loaded_; }
  bool has_surface() const { return has_surface_; }

  /// Copies the meshes of a tile; nullopt if the scene does not have it.
  std::optional<std::vector<imaging::TexturedMesh>> copy_meshes(const TileKey& key) const;

 private:
  using Parts = std::vector<std::shared_ptr<const ResidentPart>>;

  struct Labels {
    render::SceneObjects objects;
    std::vector<std::string> names;     ///< of the objects
    std::vector<std::string> distinct;  ///< sorted
  };
  static std::shared_ptr<const Labels> labels_with(const Labels& place, const scene::Scene& scene);

  /// `whole`: the single part, or none.
  ResidentScene(std::vector<ResidentTile> tiles, const Parts& whole, const scene::SceneFrame& frame,
                LoadedRegion loaded);

  std::vector<ResidentTile> tiles_;
  std::vector<std::uint32_t> tile_of_mesh_;  ///< for each mesh of the scene
  bool has_surface_ = false;
  Parts parts_;
  scene::Scene scene_;
  std::shared_ptr<const render::Appearance> appearance_;
  std::shared_ptr<const Labels> labels_;
  std::uint32_t first_placed_object_ = 0;
  std::vector<geometry::Box3> object_bounds_;
  LoadedRegion loaded_;
};

/// Computes the memory of a tile's meshes in a scene: geometry, tree for beams, textures and their mipmaps, and a share
/// for the trees for rays, which are built where rays go.
std::uintmax_t resident_bytes(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::simulator
