#pragma once

// Frame and scale of a map from prior knowledge at its start: poses or depth images.

#include <optional>

#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// Similarity from the estimated to the known poses: rotation from the mean orientation difference (a straight path is
/// enough), scale and translation from the camera centres by least squares. nullopt with fewer than two pairs or
/// without a baseline between them.
std::optional<geometry::Sim3> similarity_from_poses(const std::vector<geometry::SE3>& T_map_camera,
                                                    const std::vector<geometry::SE3>& T_world_camera);

/// Transforms map, trajectory and keyframes. Inverse-depth variances scale with the inverse square of the scale factor.
void transform_result(const geometry::Sim3& T_world_map, OdometryResult& result);

/// Frame and scale of the map from the known poses of images up to `until_s`, or its scale from the depth images of
/// keyframes (median over the points they host). nullopt without either. Throws InputError if fewer than two prior
/// poses overlap the start of the trajectory or they have no baseline, and if no point can be compared with a depth
/// image.
std::optional<geometry::Sim3> find_T_world_map(const imaging::Camera& camera, const OdometryInput& input,
                                               double until_s, const OdometryResult& result);

/// Transforms the result by find_T_world_map(); leaves it unchanged without priors. Throws as that does.
void apply_priors(const imaging::Camera& camera, const OdometryInput& input, double until_s, OdometryResult& result);

}  // namespace tileflight::odometry
