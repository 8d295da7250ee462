#pragma once

#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::alignment {

/// Similarity that carries poses to the poses of the same moments in another frame: the rotation is the chordal mean of
/// those between the paired orientations (Hartley et al., IJCV 103(3), 2013, section 5.3), scale and translation are
/// the least squares of the positions for it. A straight path, whose positions leave the turn about it open, determines
/// it all. Without spread of the positions the scale is 1. Throws InputError for empty lists or lists of different
/// lengths.
geometry::Sim3 fit_poses(const std::vector<geometry::SE3>& source, const std::vector<geometry::SE3>& target);

}  // namespace tileflight::alignment
