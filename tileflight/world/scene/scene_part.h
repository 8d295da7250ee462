#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "tileflight/core/imaging/textured_mesh.h"

struct RTCDeviceTy;

namespace tileflight::scene {

class BeamTree;
struct EmbreeTree;

/// What the parts of a scene have in common: the origin of their float coordinates, and Embree's state. Copies are the
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
  /// The meshes, after which the part can only be destroyed.
  std::vector<imaging::TexturedMesh> release_meshes() &&;
  /// Of all vertices of meshes with triangles, local frame.
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

/// Bounds of all vertices of the meshes that have triangles.
geometry::Box3 bounds_of(const std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::scene
