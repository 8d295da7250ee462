#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/world/scene/scene.h"

namespace tileflight::render {

/// An object of a segmentation: a feature of a tile (a building, a tree, ...), the part of a tile that belongs to no
/// feature, or a placed part of the scene.
struct SceneObject {
  std::string tile;        ///< the name of its meshes; of a placed part, its own
  std::uint32_t mesh = 0;  ///< first mesh, by number within the tile, that uses this feature table; 0 for a tile
  std::uint32_t feature = imaging::kNoFeature;
  std::string name;        ///< of the feature, from its table; empty if it has none
  bool is_placed = false;  ///< a placed part, whatever features its meshes have
};

/// The objects of a scene, in the order of its meshes and, within a mesh, of their feature ids. Each placed part is an
/// object of its own, after all others and in the order of Scene::placed(). They hold for all scenes of the same parts
/// and placed parts, whatever their poses.
class SceneObjects {
 public:
  explicit SceneObjects(const scene::Scene& scene);
  /// Extends the objects of a scene without placed parts to `scene`, which has the same parts and placed ones.
  SceneObjects(SceneObjects without_placed, const scene::Scene& scene);

  std::span<const SceneObject> all() const { return objects_; }
  /// Returns the index of a triangle's object in all(). A triangle belongs to the feature of its first corner.
  std::uint32_t index_of(std::uint32_t mesh, std::uint32_t triangle) const;
  /// Returns the index of the object of a feature of the mesh; kNoFeature: of its triangles without a feature.
  /// Precondition: the mesh has it.
  std::uint32_t index_of_feature(std::uint32_t mesh, std::uint32_t feature) const;

 private:
  using NumberedFeature = std::pair<std::uint32_t, std::uint32_t>;  ///< feature id, index into objects_

  void add_placed(const scene::Scene& scene);

  struct MeshObjects {
    const imaging::TexturedMesh* mesh = nullptr;
    std::uint32_t tile_object = 0;          ///< index into objects_ for triangles without a feature
    std::vector<NumberedFeature> features;  ///< sorted
    bool is_placed = false;                 ///< then all triangles are of tile_object
  };

  std::vector<SceneObject> objects_;
  std::vector<MeshObjects> meshes_;
};

}  // namespace tileflight::render
