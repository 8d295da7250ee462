#pragma once

// Frame and scale of a map from what was known when it began: poses, or depth.

#include <optional>

#include "tileflight/odometry/odometry.h"

namespace tileflight::odometry {

/// The similarity that takes the estimated poses to the known ones: rotation from the mean of the orientations'
/// differences (so that a straight path is enough), scale and position from the camera centres by least squares.
/// nullopt with fewer than two pairs or without a baseline between them.
std::optional<geometry::Sim3> similarity_of_poses(const std::vector<geometry::SE3>& T_map_camera,
                                                  const std::vector<geometry::SE3>& T_world_camera);

/// Moves map, trajectory and keyframes. Inverse-depth variances go with the square of the scale.
void move_result(const geometry::Sim3& T_world_map, OdometryResult& result);

/// Frame and scale from the known poses of the pictures up to `until_s`, or scale from the depth of keyframes that have
/// one (median over the points that they host); unchanged without either. Throws InputError for poses that share fewer
/// than two times with the trajectory's beginning or have no baseline there, and for depth that no point can be
/// compared to.
void place(const imaging::Camera& camera, const Aids& aids, double until_s, OdometryResult& result);

}  // namespace tileflight::odometry
