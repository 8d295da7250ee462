#pragma once

#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::odometry {

/// Poses at which the next picture may be, most probable first (section 3.1, step 1): constant, double, half and no
/// velocity since the last picture, the keyframe's own pose, then small rotations about the first. All are
/// T_camera_reference. `T_last_before_last`: last motion; `turns`: number of rotation sizes tried, each twice the one
/// before.
std::vector<geometry::SE3> motion_hypotheses(const geometry::SE3& T_last_reference,
                                             const geometry::SE3& T_last_before_last, int turns);

}  // namespace tileflight::odometry
