#pragma once

// Marginalisation: points and keyframes that leave the window become a quadratic prior. DSO, section 2.3,
// "Marginalization", eq. 15 to 19.

#include <vector>

#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {

/// Adds the good residuals of these points, linearised at the keyframes' linearisation points, to the window's prior
/// (scaled by `weight`). The caller removes the points.
void marginalize_points(keyframes::Window& window, const std::vector<HostTargetPair>& pairs,
                        const std::vector<PointRef>& points, double weight);

/// The quadratic form delta^T H delta + 2 b^T delta.
struct QuadraticPrior {
  Eigen::MatrixXd H;
  Eigen::VectorXd b;
};
/// Eliminates the 8 unknowns of `slot`, or of any other block of eight, by the Schur complement: DSO, eq. 16 to 18.
QuadraticPrior marginalize_keyframe(const QuadraticPrior& prior, int slot);

/// Marginalises any unknowns of a prior; `leaving` holds their numbers in increasing order.
QuadraticPrior marginalize_unknowns(const QuadraticPrior& prior, const std::vector<int>& leaving);

/// Removes a keyframe from the window: marginalises its unknowns in the prior, removes observations in it, and
/// renumbers later slots. Its own points must have been marginalised or dropped before; any left are removed with it.
void remove_keyframe(keyframes::Window& window, int slot);

/// Information (inverse variance) of the given intrinsics: of the focal length, of the difference of fx and fy (both as
/// shares of the focal length), and of each coordinate of the principal point (in focal lengths).
struct IntrinsicsInformation {
  double focal_length = 0.0;
  double aspect = 0.0;
  double principal_point = 0.0;
};

/// Adds focal lengths and principal point as unknowns to an empty window.
void add_intrinsics_unknowns(keyframes::Window& window, const IntrinsicsInformation& information);

/// Appends a keyframe; the prior grows by its unknowns, zero but for the prior on its brightness (DSO, eq. 9) and on
/// that of its stereo pictures.
void add_keyframe(keyframes::Window& window, keyframes::Keyframe keyframe);

/// Reverses the order of the keyframes: slot i becomes slot size - 1 - i, in the prior and the observations, too. What
/// the window estimates stays the same.
void reverse_keyframes(keyframes::Window& window);

}  // namespace tileflight::mapping
