#pragma once

// Whether two cameras' pictures of one instant agree with how the rig's calibration places the cameras: corners are
// followed from one into the other, freely in the image, and their rays compared with the epipolar planes.

#include <optional>

#include "tileflight/slam/odometry/odometry.h"
#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::odometry {

/// The rotation of the other camera that makes the rays of the matches meet best: b' = exp(w) b, sum of squared
/// distances (b' . n) of the rays from their epipolar planes (normals n = a x c, with the other camera's centre in
/// direction -c), robust (Cauchy). nullopt with fewer than 40 corners found in both pictures, or if no rotation fits
/// half of them. `own`: all levels; `other`: level 0.
std::optional<RigFit> check_rig(const keyframes::LensPyramid& lens, const keyframes::Pyramid& own,
                                const keyframes::StereoCamera& camera, const keyframes::PyramidLevel& other);

}  // namespace tileflight::odometry
