#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/scene/scene.h"
#include "tileflight/sensors/appearance.h"
#include "tileflight/sensors/scene_objects.h"
#include "tileflight/simulator/own_types.h"

namespace tileflight::simulator {

/// Meshes of one tile's content.
struct PlacedTile {
  std::string identity;  ///< as tiles::CutContent names it
  double geometric_error_m = 0.0;
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame
};

/// A working set: what is in memory at a time, ready for rays and pictures. Immutable, shared by all who use it; the
/// next one takes its place when other tiles are wanted.
class Place {
 public:
  /// `anchor`: the same for all places of a session, so that a surface is the same to the last bit in each. What tiles
  /// look like is taken over from the place `before` where that has them too.
  Place(std::vector<PlacedTile> tiles, const geometry::Vec3& anchor, LoadedRegion loaded,
        const Place* before = nullptr);

  const scene::Scene& scene() const { return scene_; }
  const std::shared_ptr<const sensors::Appearance>& appearance() const { return appearance_; }
  const sensors::SceneObjects& objects() const { return objects_; }
  /// Of each of objects().all(): what clients know it by.
  const std::vector<std::string>& object_names() const { return object_names_; }
  /// Of each of objects().all(), of all of its triangles, local frame.
  const std::vector<geometry::Box3>& object_bounds() const { return object_bounds_; }
  /// Distinct, sorted.
  const std::vector<std::string>& distinct_names() const { return distinct_names_; }
  /// Of the tile that a mesh of the scene belongs to.
  double geometric_error_m(std::uint32_t mesh) const { return tiles_[tile_of_mesh_[mesh]].geometric_error_m; }
  std::uint32_t tile_of_mesh(std::uint32_t mesh) const { return tile_of_mesh_[mesh]; }
  const LoadedRegion& loaded() const { return loaded_; }
  bool has_surface() const { return has_surface_; }

  /// The meshes of a tile as they were given, copied; empty where it is not here. Identities may be in several tiles.
  const PlacedTile* find(const std::string& identity) const;
  std::vector<imaging::TexturedMesh> meshes_of(const PlacedTile& tile) const;

 private:
  std::vector<PlacedTile> tiles_;            ///< without their meshes, which the scene has
  std::vector<std::size_t> first_mesh_;      ///< of each tile, and one past the last
  std::vector<std::uint32_t> tile_of_mesh_;  ///< of each of the scene's meshes
  bool has_surface_ = false;
  scene::Scene scene_;
  std::shared_ptr<const sensors::Appearance> appearance_;
  sensors::SceneObjects objects_;
  std::vector<geometry::Box3> object_bounds_;
  std::vector<std::string> object_names_;
  std::vector<std::string> distinct_names_;
  std::map<std::string, std::size_t> tile_of_identity_;
  LoadedRegion loaded_;
};

/// What a tile's meshes take in memory once they are in a place: geometry, trees, textures and their pyramids.
std::uintmax_t place_bytes(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::simulator
