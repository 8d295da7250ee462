#pragma once

#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::alignment {

/// Similarity between paired poses in two frames: the rotation is the chordal mean of the rotations between the paired
/// orientations (Hartley et al., IJCV 103(3), 2013, section 5.3); scale and translation follow by least squares of the
/// positions. It is determined even for a straight path, whose positions alone do not determine the rotation about it.
/// The scale is 1 if all positions coincide. Throws InputError for empty lists or lists of different lengths.
geometry::Sim3 fit_poses(const std::vector<geometry::SE3>& source, const std::vector<geometry::SE3>& target);

}  // namespace tileflight::alignment
