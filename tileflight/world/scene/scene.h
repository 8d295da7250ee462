#pragma once

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/world/scene/scene_part.h"

namespace tileflight::scene {

struct RayPacket8;  // packets.h

/// Intersection of a ray with the scene.
struct Hit {
  double distance_m = 0.0;     ///< along the unit ray, computed from the triangle's plane in double precision
  std::uint32_t mesh = 0;      ///< index into Scene::meshes()
  std::uint32_t triangle = 0;  ///< index into that mesh's triangles
  float u = 0.0F, v = 0.0F;    ///< barycentric weights of corners 1 and 2
  double time = 0.0;           ///< the ray's
};

struct Ray {
  geometry::Vec3 origin;     ///< local frame, metres
  geometry::Vec3 direction;  ///< unit length
  double time = 0.0;         ///< of the scene, 0 to 1, for placed parts that move (scene_part.h)
};

/// A static scene in a local frame: textured triangles, and acceleration structures for two kinds of queries. Single
/// rays and packets use Embree, beams a tree of our own (beam_tree.h). Both hold positions as floats relative to
/// `anchor()`, to keep millimetre precision far from the frame's origin, and both are watertight along edges: a ray
/// through an edge shared by two triangles hits one of them (a ray within a micrometre of a corner may slip through).
/// Each tree is built by the first query of its kind, or explicitly. Immutable; queries may run in parallel, and
/// results do not depend on the number of threads.
///
/// A scene of meshes has one tree of each kind over all triangles, which is the fastest to query: for places that are
/// loaded whole. A scene of parts shares the parts' trees with other scenes and adds a small tree over the parts, so
/// that one more tile costs its own tree only: for the server, whose tiles come and go. Both give the same hits, to the
/// last bit (except that of surfaces at exactly the same distance, rays and packets may name another).
///
/// Parts may also be placed (scene_part.h): cars, people, what clients of the server set up. Another pose costs a new
/// scene, which shares all parts' trees. They answer queries in their own coordinates, so hits agree with those on the
/// same meshes moved to their place within float rounding.
class Scene {
 public:
  /// A view of the meshes of all parts, in their order. References to meshes outlive it, which GCC 14 needs to be told.
#if __has_cpp_attribute(gnu::no_dangling)
  class [[gnu::no_dangling]] Meshes {
#else
  class Meshes {
#endif
   public:
    class Iterator {
     public:
      using iterator_category = std::forward_iterator_tag;
      using value_type = imaging::TexturedMesh;
      using difference_type = std::ptrdiff_t;
      using pointer = const imaging::TexturedMesh*;
      using reference = const imaging::TexturedMesh&;

      Iterator() = default;
      explicit Iterator(const imaging::TexturedMesh* const* at) : at_(at) {}
      reference operator*() const { return **at_; }
      pointer operator->() const { return *at_; }
      Iterator& operator++() {
        ++at_;
        return *this;
      }
      Iterator operator++(int) { return Iterator(at_++); }
      bool operator==(const Iterator&) const = default;

     private:
      const imaging::TexturedMesh* const* at_ = nullptr;
    };

    explicit Meshes(std::span<const imaging::TexturedMesh* const> all) : all_(all) {}
    std::size_t size() const { return all_.size(); }
    bool empty() const { return all_.empty(); }
    const imaging::TexturedMesh& operator[](std::size_t mesh) const { return *all_[mesh]; }
    Iterator begin() const { return Iterator(all_.data()); }
    Iterator end() const { return Iterator(all_.data() + all_.size()); }

   private:
    std::span<const imaging::TexturedMesh* const> all_;
  };

  /// Takes the meshes (positions in the local frame). Throws InputError (mesh name, cause) if there is no triangle, a
  /// coordinate is not finite, a triangle refers to a missing vertex, or an attribute does not have one value per
  /// vertex.
  /// `anchor`: origin of float coordinates; default: the centre of the bounds.
  explicit Scene(std::vector<imaging::TexturedMesh> meshes, const std::optional<geometry::Vec3>& anchor = {});
  /// Makes a scene of these parts, at least one, all of one SceneFrame. Throws InputError if there is no triangle.
  explicit Scene(std::vector<std::shared_ptr<const ScenePart>> parts);
  /// Makes a scene of parts and placed parts, whose meshes follow. Throws InputError also for a wrong pose.
  Scene(std::vector<std::shared_ptr<const ScenePart>> parts, std::vector<PlacedPart> placed);
  ~Scene();
  Scene(Scene&&) noexcept;
  Scene& operator=(Scene&&) noexcept;

  Meshes meshes() const;
  const std::vector<std::shared_ptr<const ScenePart>>& parts() const;
  const std::vector<PlacedPart>& placed() const;
  /// Returns the number of meshes of parts() alone. Later meshes are those of placed parts, in the parts' own
  /// coordinates.
  std::uint32_t first_placed_mesh() const;
  /// Returns the index into placed(). Precondition: mesh >= first_placed_mesh().
  std::size_t placed_of_mesh(std::uint32_t mesh) const;
  /// Returns the pose of a placed part at a time of the scene: p_local = pose * p_part.
  Eigen::Affine3d placed_pose(std::size_t placed, double time) const;
  /// Returns the bounds of a placed part at all times of the scene, local frame.
  const geometry::Box3& placed_bounds(std::size_t placed) const;
  /// Ends a scene that was made of meshes, and returns them.
  std::vector<imaging::TexturedMesh> release_meshes() &&;
  const geometry::Box3& bounds() const;  ///< of all vertices, local frame
  const geometry::Vec3& anchor() const;
  std::size_t triangle_count() const;

  /// Build the tree for rays and packets, or the one for beams, in advance on all cores, so that no query has to wait.
  /// Throw std::runtime_error if memory is insufficient, as the first query would otherwise.
  void build_ray_tree() const;
  void build_beam_tree() const;

  /// Finds the nearest surface along the ray, front or back face.
  std::optional<Hit> intersect(const Ray& ray, double max_distance_m = 1e9) const;
  /// Tells whether any surface lies within `max_distance_m` along the ray.
  bool is_occluded(const Ray& ray, double max_distance_m) const;
  /// Returns the distance from a point to the nearest surface; nullopt if it exceeds `within_m`.
  std::optional<double> distance_to_surface_m(const geometry::Vec3& point, double within_m, double time = 0.0) const;
  /// Finds the nearest hits of eight rays at once, in floats relative to anchor(); see packets.h.
  void intersect(RayPacket8& packet) const;
  /// Finds the nearest hits of a beam: one to eight packets of neighbouring rays with a common origin and time. Every
  /// lane, enabled or not, needs a direction; near and far limits are not supported. Three times as fast as packets.
  void intersect(std::span<RayPacket8> beam) const;
  /// Finds the nearest hits of beams of a camera that moves: each ray has its own origin and time, all rays of all
  /// beams near each other. At most kMostMovingBeams (beam_tree.h) at once share one traversal: neighbouring rays at
  /// the moments of an exposure. A ray's hit is that of a beam from its origin, within rounding; if all origins are
  /// equal (and so are the times, or nothing is placed), a single beam's results are the same to the last bit.
  void intersect_moving(std::span<const std::span<RayPacket8>> beams) const;
  /// Tests eight rays for occlusion: sets `far` to -infinity in lanes where a surface lies between near and far;
  /// nothing else of the packet changes. Disabled lanes stay disabled.
  void test_occlusion(RayPacket8& packet) const;

  geometry::Vec3 position(const Hit& hit) const;
  geometry::Vec3 normal(const Hit& hit) const;  ///< unit, oriented by the winding; zero for a degenerate triangle

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Merges all triangles of all meshes into one mesh without appearance (vertices are not welded).
geometry::TriangleMesh merge_meshes(const std::vector<imaging::TexturedMesh>& meshes);
geometry::TriangleMesh merge_meshes(const Scene::Meshes& meshes);

}  // namespace tileflight::scene
