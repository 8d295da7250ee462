#pragma once

// What leaves the window leaves a quadratic prior behind: section 2.3, "Marginalization", eq. 15 to 18, of the paper.

#include <vector>

#include "tileflight/odometry/normal_equations.h"

namespace tileflight::odometry {

/// Folds the good residuals of these points, linearised about the keyframes' linearisation points, into the window's
/// prior (scaled by `weight`). The points themselves stay; the caller removes them.
void marginalize_points(Window& window, const std::vector<Pair>& pairs, const std::vector<PointRef>& points,
                        double weight);

/// The quadratic form delta^T H delta + 2 b^T delta with the 8 unknowns of `slot` minimised out: eq. 16, 17.
struct Prior {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};
Prior without_keyframe(const Prior& prior, int slot);

/// Takes the keyframe out of the window: its unknowns out of the prior, observations in it away, slots above it moved
/// down. Its own points must have been marginalised or dropped; what is left of them goes with it.
void remove_keyframe(Window& window, int slot);

/// How firmly the given lens is known: information on the focal length, on the difference of the two (shares of the
/// focal length) and on each coordinate of the principal point (in focal lengths).
struct LensInformation {
  double focal_length = 0.0;
  double aspect = 0.0;
  double principal_point = 0.0;
};

/// Makes the lens's focal lengths and principal point unknowns of an empty window.
void estimate_lens(Window& window, const LensInformation& information);

/// Appends a keyframe; the prior grows by its (zero) unknowns and the prior on its light.
void add_keyframe(Window& window, Keyframe keyframe);

}  // namespace tileflight::odometry
