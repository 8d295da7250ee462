#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::scene {

struct RayPacket8;  // packets.h

/// Where a ray met the scene.
struct Hit {
  double distance_m = 0.0;     ///< along the unit ray, from the triangle's plane in double precision
  std::uint32_t mesh = 0;      ///< index into Scene::meshes()
  std::uint32_t triangle = 0;  ///< index into that mesh's triangles
  float u = 0.0F, v = 0.0F;    ///< barycentric weights of corners 1 and 2
};

struct Ray {
  geometry::Vec3 origin;     ///< local frame, metres
  geometry::Vec3 direction;  ///< unit length
};

/// One place in a local frame: textured triangles, and trees over them for two kinds of questions. Single rays and
/// packets are answered by Embree, beams by a tree of our own (beam_tree.h). Both hold the positions as floats relative
/// to `anchor()`, so that they keep their millimetres wherever the frame's origin lies, and both are watertight along
/// edges: a ray through an edge that two triangles share meets one of them (aimed to the micrometre at a corner, it may
/// slip through). Each tree is built when the first question of its kind is asked, or beforehand. Immutable; queries
/// may run in parallel, and answers do not depend on the number of threads.
class Scene {
 public:
  /// Takes the meshes (positions in the local frame). Throws InputError (mesh name, cause) when there is no triangle,
  /// a coordinate is not finite, a triangle names a vertex that is not there, or an attribute has not one value a
  /// vertex.
  /// `anchor`: what coordinates are relative to where they are floats; none given: the middle of the bounds.
  explicit Scene(std::vector<imaging::TexturedMesh> meshes, const std::optional<geometry::Vec3>& anchor = {});
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  const std::vector<imaging::TexturedMesh>& meshes() const;
  const geometry::Box3& bounds() const;  ///< of all vertices, local frame
  const geometry::Vec3& anchor() const;
  std::size_t triangle_count() const;

  /// Build the tree for rays and packets, or the one for beams, now and on all cores, so that no question waits for it.
  /// Throw std::runtime_error when there is no memory, as the first question does otherwise.
  void prepare_rays() const;
  void prepare_beams() const;

  /// The nearest surface along the ray, seen from either side.
  std::optional<Hit> intersect(const Ray& ray, double max_distance_m = 1e9) const;
  /// Whether any surface lies within `max_distance_m` along the ray.
  bool occluded(const Ray& ray, double max_distance_m) const;
  /// Distance from a point to the nearest surface, where that is within `within_m`.
  std::optional<double> nearest_m(const geometry::Vec3& point, double within_m) const;
  /// Nearest hits of eight rays at once, in floats relative to anchor(): see packets.h.
  void intersect(RayPacket8& packet) const;
  /// The same for a beam: one to eight packets of neighbouring rays, all of which start where the first does. Every
  /// lane has a direction, whether it is on or off, and neither a near nor a far limit. Three times as fast as packets.
  void intersect(std::span<RayPacket8> beam) const;
  /// Whether anything is in the way of eight rays: `far` becomes -infinity in lanes where something is between their
  /// near and far, and nothing else of the packet changes. A lane that was off stays so.
  void occlude(RayPacket8& packet) const;

  geometry::Vec3 position(const Hit& hit) const;
  geometry::Vec3 normal(const Hit& hit) const;  ///< unit, by the triangle's winding; zero for a triangle without area

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All triangles of all meshes as one mesh without appearance (corners as they are, not welded).
geometry::TriangleMesh merged(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::scene
