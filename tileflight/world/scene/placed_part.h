#pragma once

#include <memory>
#include <string>
#include <vector>

#include "tileflight/world/scene/scene_part.h"

namespace tileflight::scene {

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
