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

/// Intersection of a ray with the scene.
struct Hit {
  double distance_m = 0.0;     ///< along the unit ray, computed from the triangle's plane in double precision
  std::uint32_t mesh = 0;      ///< index into Scene::meshes()
  std::uint32_t triangle = 0;  ///< index into that mesh's triangles
  float u = 0.0F, v = 0.0F;    ///< barycentric weights of corners 1 and 2
};

struct Ray {
  geometry::Vec3 origin;     ///< local frame, metres
  geometry::Vec3 direction;  ///< unit length
};

/// A static scene in a local frame: textured triangles, and acceleration structures for two kinds of queries. Single
/// rays and packets use Embree, beams a tree of our own (beam_tree.h). Both hold positions as floats relative to
/// `anchor()`, to keep millimetre precision far from the frame's origin, and both are watertight along edges: a ray
/// through an edge shared by two triangles hits one of them (a ray within a micrometre of a corner may slip through).
/// Each tree is built by the first query of its kind, or explicitly. Immutable; queries may run in parallel, and
/// results do not depend on the number of threads.
class Scene {
 public:
  /// Takes the meshes (positions in the local frame). Throws InputError (mesh name, cause) if there is no triangle, a
  /// coordinate is not finite, a triangle refers to a missing vertex, or an attribute does not have one value per
  /// vertex.
  /// `anchor`: origin of float coordinates; default: the centre of the bounds.
  explicit Scene(std::vector<imaging::TexturedMesh> meshes, const std::optional<geometry::Vec3>& anchor = {});
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  const std::vector<imaging::TexturedMesh>& meshes() const;
  /// Ends the scene and returns its meshes.
  std::vector<imaging::TexturedMesh> release_meshes() &&;
  const geometry::Box3& bounds() const;  ///< of all vertices, local frame
  const geometry::Vec3& anchor() const;
  std::size_t triangle_count() const;

  /// Build the tree for rays and packets, or the one for beams, in advance on all cores, so that no query has to wait.
  /// Throw std::runtime_error if memory is insufficient, as the first query would otherwise.
  void build_ray_tree() const;
  void build_beam_tree() const;

  /// The nearest surface along the ray, front or back face.
  std::optional<Hit> intersect(const Ray& ray, double max_distance_m = 1e9) const;
  /// Whether any surface lies within `max_distance_m` along the ray.
  bool is_occluded(const Ray& ray, double max_distance_m) const;
  /// Distance from a point to the nearest surface; nullopt if it exceeds `within_m`.
  std::optional<double> distance_to_surface_m(const geometry::Vec3& point, double within_m) const;
  /// Nearest hits of eight rays at once, in floats relative to anchor(); see packets.h.
  void intersect(RayPacket8& packet) const;
  /// Nearest hits of a beam: one to eight packets of neighbouring rays with a common origin. Every lane, enabled or
  /// not, needs a direction; near and far limits are not supported. Three times as fast as packets.
  void intersect(std::span<RayPacket8> beam) const;
  /// Occlusion test of eight rays: sets `far` to -infinity in lanes where a surface lies between near and far; nothing
  /// else of the packet changes. Disabled lanes stay disabled.
  void test_occlusion(RayPacket8& packet) const;

  geometry::Vec3 position(const Hit& hit) const;
  geometry::Vec3 normal(const Hit& hit) const;  ///< unit, oriented by the winding; zero for a degenerate triangle

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// All triangles of all meshes as one mesh without appearance (vertices are not welded).
geometry::TriangleMesh merge_meshes(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::scene
