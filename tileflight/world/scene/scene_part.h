#pragma once

struct RTCDeviceTy;

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::scene {

class BeamTree;
struct EmbreeTree;

/// Frame that the parts of a scene share: the origin of their float coordinates, and Embree's state. Copies are the
/// same frame.
class SceneFrame {
 public:
  /// Throws std::runtime_error if memory is insufficient.
  explicit SceneFrame(const geometry::Vec3& anchor);

  const geometry::Vec3& anchor() const { return anchor_; }
  const std::shared_ptr<RTCDeviceTy>& device() const { return device_; }

 private:
  geometry::Vec3 anchor_;  ///< local frame, metres
  std::shared_ptr<RTCDeviceTy> device_;
};

/// Meshes with the acceleration structures over them, which several scenes may share (scene.h): a tile, or a whole
/// place. Immutable; each tree is built by the first query of its kind, or explicitly.
class ScenePart {
 public:
  /// Takes the meshes (positions in the local frame); there may be none. Throws InputError as Scene's constructor, but
  /// not for a missing triangle.
  ScenePart(std::vector<imaging::TexturedMesh> meshes, const SceneFrame& frame);
  ~ScenePart();
  ScenePart(const ScenePart&) = delete;
  ScenePart& operator=(const ScenePart&) = delete;

  const std::vector<imaging::TexturedMesh>& meshes() const;
  /// Returns the meshes, after which the part can only be destroyed.
  std::vector<imaging::TexturedMesh> release_meshes() &&;
  /// Returns the bounds of all vertices of meshes with triangles, local frame.
  const geometry::Box3& bounds() const;
  const SceneFrame& frame() const;
  std::size_t triangle_count() const;

  /// Build the trees if there are triangles. Throw std::runtime_error if memory is insufficient.
  void build_ray_tree() const;
  void build_beam_tree() const;
  /// Precondition: there is a triangle.
  const EmbreeTree& ray_tree() const;
  const BeamTree& beam_tree() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Returns the bounds of all vertices of the meshes that have triangles.
geometry::Box3 bounds_of(const std::vector<imaging::TexturedMesh>& meshes);

/// A part that stands or moves in a scene, such as a car: its meshes have coordinates of their own, and other places in
/// scenes cost nothing but a pose (its trees are built once). Several may show the same part.
struct PlacedPart {
  std::string name;  ///< of the object
  std::shared_ptr<const ScenePart> part;
  /// p_local = pose * p_part, at even steps of the scene's time from 0 to 1 (Ray::time); between them each point moves
  /// on a straight line. At least one, which stands still. Determinants are positive: no mirrors.
  std::vector<Eigen::Affine3d> poses;
};

/// p_local = T_local_part * (scale * p_part), for each axis its scale, above 0.
Eigen::Affine3d placed_at(const geometry::SE3& T_local_part, const geometry::Vec3& scale = geometry::Vec3::Ones());

}  // namespace tileflight::scene
