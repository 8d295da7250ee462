#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/scene/scene.h"

namespace tileflight::render {

/// An object of a segmentation: a feature of a tile (a building, a tree, ...), or the part of a tile that belongs to no
/// feature.
struct SceneObject {
  std::string tile;        ///< the name of its meshes
  std::uint32_t mesh = 0;  ///< first mesh, by number within the tile, that uses this feature table; 0 for a tile
  std::uint32_t feature = imaging::kNoFeature;
  std::string name;  ///< of the feature, from its table; empty if it has none
};

/// The objects of a scene, in the order of its meshes and, within a mesh, of their feature ids.
class SceneObjects {
 public:
  explicit SceneObjects(const scene::Scene& scene);

  std::span<const SceneObject> all() const { return objects_; }
  /// Index into all(). A triangle belongs to the feature of its first corner.
  std::uint32_t index_of(std::uint32_t mesh, std::uint32_t triangle) const;
  /// The same for a feature of the mesh; kNoFeature: its triangles without a feature. Precondition: it has such.
  std::uint32_t index_of_feature(std::uint32_t mesh, std::uint32_t feature) const;

 private:
  using NumberedFeature = std::pair<std::uint32_t, std::uint32_t>;  ///< feature id, index into objects_

  struct MeshObjects {
    const imaging::TexturedMesh* mesh = nullptr;
    std::uint32_t tile_object = 0;          ///< index into objects_ for triangles without a feature
    std::vector<NumberedFeature> features;  ///< sorted
  };

  std::vector<SceneObject> objects_;
  std::vector<MeshObjects> meshes_;
};

}  // namespace tileflight::render
