#pragma once

// Alignment of a corner's patch in the keyframe where it was found to later keyframes, by an affine warp, gain and
// offset (Shi and Tomasi, CVPR 1994). Following from image to image adds up errors; this does not.

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::self_calibration {

/// States how a patch appears in another image: the offset d from its middle is at `pixel` + `shape` d.
struct PatchWarp {
  Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();
};

/// Holds grey values around a corner, row by row.
class Patch {
 public:
  static constexpr int kRadius = 7;

  /// `pixel`: whole, at least kRadius + 1 from the edge.
  Patch(const keyframes::PyramidLevel& image, int x, int y);

  /// Returns the warp in another image, from a guess; nullopt if the patch leaves the image, looks otherwise, or ends
  /// more than 2 pixels from the guess.
  std::optional<PatchWarp> align(const keyframes::PyramidLevel& image, const PatchWarp& guess) const;

 private:
  std::vector<float> values_;
};

}  // namespace tileflight::self_calibration
