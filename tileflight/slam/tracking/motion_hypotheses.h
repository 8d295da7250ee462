#pragma once

#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::tracking {

/// Candidate poses T_camera_reference of the next image, most probable first (DSO, section 3.1, step 1): constant,
/// double, half and zero velocity since the last image, the keyframe's own pose, then small rotations about the first.
/// `T_last_before_last`: last motion; `turns`: number of rotation magnitudes tried, each twice the one before.
std::vector<geometry::SE3> motion_hypotheses(const geometry::SE3& T_last_reference,
                                             const geometry::SE3& T_last_before_last, int turns);

}  // namespace tileflight::tracking
