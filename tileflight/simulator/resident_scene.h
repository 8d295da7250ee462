#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/render/appearance.h"
#include "tileflight/render/scene_objects.h"
#include "tileflight/scene/scene.h"
#include "tileflight/simulator/extension_types.h"

namespace tileflight::simulator {

/// The meshes of a tile's content.
struct ResidentTile {
  std::string identity;  ///< as in tiles::CutContent
  double geometric_error_m = 0.0;
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame
};

/// A working set: the tiles in memory, prepared for ray casting and rendering. Immutable and shared by all users;
/// replaced by a new one when other tiles are needed.
class ResidentScene {
 public:
  /// `anchor`: reference point, the same for all scenes of a session, so that surfaces are bit-identical in each. The
  /// appearance of tiles that `before` also holds is reused from it.
  ResidentScene(std::vector<ResidentTile> tiles, const geometry::Vec3& anchor, LoadedRegion loaded,
                const ResidentScene* before = nullptr);

  const scene::Scene& scene() const { return scene_; }
  const std::shared_ptr<const render::Appearance>& appearance() const { return appearance_; }
  const render::SceneObjects& objects() const { return objects_; }
  /// For each of objects().all(), the name under which clients know it.
  const std::vector<std::string>& object_names() const { return object_names_; }
  /// For each of objects().all(), the bounds of all its triangles, local frame.
  const std::vector<geometry::Box3>& object_bounds() const { return object_bounds_; }
  /// Object names without duplicates, sorted.
  const std::vector<std::string>& distinct_names() const { return distinct_names_; }
  /// Geometric error of the tile that a mesh of the scene belongs to.
  double geometric_error_m(std::uint32_t mesh) const { return tiles_[tile_of_mesh_[mesh]].geometric_error_m; }
  std::uint32_t tile_of_mesh(std::uint32_t mesh) const { return tile_of_mesh_[mesh]; }
  const LoadedRegion& loaded() const { return loaded_; }
  bool has_surface() const { return has_surface_; }

  /// find(): the tile with this identity, or nullptr; copy_meshes(): a copy of its original meshes. Identities may
  /// occur in several tiles.
  const ResidentTile* find(const std::string& identity) const;
  std::vector<imaging::TexturedMesh> copy_meshes(const ResidentTile& tile) const;

 private:
  std::vector<ResidentTile> tiles_;          ///< without their meshes, which are in the scene
  std::vector<std::size_t> first_mesh_;      ///< first mesh of each tile, and one past the last
  std::vector<std::uint32_t> tile_of_mesh_;  ///< for each mesh of the scene
  bool has_surface_ = false;
  scene::Scene scene_;
  std::shared_ptr<const render::Appearance> appearance_;
  render::SceneObjects objects_;
  std::vector<geometry::Box3> object_bounds_;
  std::vector<std::string> object_names_;
  std::vector<std::string> distinct_names_;
  std::map<std::string, std::size_t> tile_of_identity_;
  LoadedRegion loaded_;
};

/// Memory used by a tile's meshes in a scene: geometry, ray tracing acceleration structures, textures and their
/// mipmaps.
std::uintmax_t resident_bytes(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::simulator
