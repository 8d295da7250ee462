#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/scene/scene.h"

namespace tileflight::sensors {

/// What a segmentation tells apart: a feature of a tile (a building, a tree, ...), or all of a tile that belongs to
/// none.
struct SceneObject {
  std::string tile;        ///< as its meshes are named
  std::uint32_t mesh = 0;  ///< first mesh of the tile, counted within it, whose feature ids mean the same; 0 for a tile
  std::uint32_t feature = imaging::kNoFeature;
  std::string name;  ///< of the feature, from its table; empty where there is none
};

/// The objects of a scene, in the order of its meshes and, in a mesh, of their feature ids.
class SceneObjects {
 public:
  explicit SceneObjects(const scene::Scene& scene);

  std::span<const SceneObject> all() const { return objects_; }
  /// Index into all(). A triangle belongs to the feature of its first corner.
  std::uint32_t of(std::uint32_t mesh, std::uint32_t triangle) const;

 private:
  using NumberedFeature = std::pair<std::uint32_t, std::uint32_t>;  ///< feature id, index into objects_

  struct MeshObjects {
    const imaging::TexturedMesh* mesh = nullptr;
    std::uint32_t tile = 0;                 ///< index into objects_ of what belongs to no feature
    std::vector<NumberedFeature> features;  ///< sorted
  };

  std::vector<SceneObject> objects_;
  std::vector<MeshObjects> meshes_;
};

}  // namespace tileflight::sensors
