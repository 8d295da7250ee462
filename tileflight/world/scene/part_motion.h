#pragma once

#include "tileflight/world/scene/scene_part.h"

namespace tileflight::scene {

/// A placed part's pose for queries: between the coordinates of the scene's trees and those of the part's (both floats
/// relative to their anchors).
struct PartTransform {
  Eigen::Matrix3f part_scene;  ///< directions, scene to part: the inverse of scene_part
  Eigen::Matrix3f scene_part;  ///< directions, part to scene
  Eigen::Matrix3f normals;     ///< normals by a triangle's winding (edge x edge), part to scene: the cofactors
  Eigen::Vector3f origin;      ///< of the part's coordinates, in those of the scene

  Eigen::Vector3f point_to_part(const Eigen::Vector3f& scene) const { return part_scene * (scene - origin); }
};

/// Motion of a placed part during a scene's time.
class PartMotion {
 public:
  /// Checks the poses. `anchor`: that of the scene. Throws InputError (the part's name) for no pose, one that is not
  /// finite, or mirrors or flattens, and for a turn by a right angle or more from one pose to the next.
  PartMotion(const PlacedPart& placed, const geometry::Vec3& anchor);

  /// Returns the pose at a time from 0 to 1; other times are taken as the nearest of these.
  Eigen::Affine3d pose(double time) const;
  PartTransform transform(float time) const;
  /// Returns the bounds of the part at all times, local frame; empty if it has no triangle.
  const geometry::Box3& bounds() const { return bounds_; }

 private:
  PartTransform transform_of(const Eigen::Affine3d& pose) const;

  std::vector<Eigen::Affine3d> poses_;
  geometry::Vec3 part_anchor_, anchor_;
  geometry::Box3 bounds_;
  PartTransform first_;  ///< at time 0, and at all times if there is one pose
};

}  // namespace tileflight::scene
