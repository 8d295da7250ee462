#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::scene {

/// Where a ray met the scene.
struct Hit {
  double distance_m = 0.0;        ///< along the unit ray
  std::uint32_t mesh = 0;         ///< index into Scene::meshes()
  std::uint32_t triangle = 0;     ///< index into that mesh's triangles
  float u = 0.0F, v = 0.0F;       ///< barycentric weights of corners 1 and 2
};

struct Ray {
  geometry::Vec3 origin;     ///< local frame, metres
  geometry::Vec3 direction;  ///< unit length
};

/// One place in a local frame: textured triangles and an Embree tree over them. Positions are held relative to
/// `anchor()`, so that floats keep their millimetres whatever the frame's origin. Immutable; queries may run in parallel.
class Scene {
 public:
  /// Takes the meshes (positions in the local frame). Throws InputError when there is no triangle or a coordinate is not finite.
  explicit Scene(std::vector<imaging::TexturedMesh> meshes);
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  const std::vector<imaging::TexturedMesh>& meshes() const;
  const geometry::Box3& bounds() const;
  const geometry::Vec3& anchor() const;
  std::size_t triangle_count() const;

  std::optional<Hit> intersect(const Ray& ray, double max_distance_m = 1e9) const;
  bool occluded(const Ray& ray, double max_distance_m) const;
  /// Nearest hit of each of 8 rays given in floats relative to anchor(); for renderers. Details in the header's packet section.

  geometry::Vec3 position(const Hit& hit) const;
  geometry::Vec3 normal(const Hit& hit) const;  ///< unit, by the triangle's winding

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All triangles of all meshes as one mesh without appearance (corners as they are, not welded).
geometry::TriangleMesh merged(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::scene
