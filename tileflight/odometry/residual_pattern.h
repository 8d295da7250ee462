#pragma once

// Whether the calibration fits the camera, from the pictures alone. A lens model that is a little wrong moves what a
// picture shows. Poses and distances take up what looks like motion; the rest stays in the residuals, the same for the
// same place in the picture and the same direction of motion. Noise is not the same: what the points of two halves of
// the keyframes have in common comes from the lens, the shutter, or from a geometry that is wrong altogether (a false
// start).

#include <array>
#include <optional>

#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/lens.h"

namespace tileflight::odometry {

/// The displacement that the points of both halves of the keyframes have in common.
struct CommonDisplacement {
  double rms_px = 0.0;  ///< at right angles to the motion in the picture, over its cells; 0 where the halves disagree
  double sigmas = 0.0;  ///< its square over the standard deviation that the square has where there is no pattern
};

class ResidualPattern {
 public:
  /// Adds the good residuals in a window's keyframe, linearised at the present state.
  void add(const Window& window, int slot, const Lens& lens);
  /// nullopt where the halves share too few cells (part of the picture, direction of motion) to tell.
  std::optional<CommonDisplacement> common() const;

 private:
  static constexpr int kColumns = 8, kRows = 6, kDirections = 8, kCells = kColumns * kRows * kDirections;

  /// Weighted least squares of one displacement, squared grey values a pixel.
  struct Cell {
    double information = 0.0;
    double pull = 0.0;  ///< information times displacement
    int residuals = 0;
  };
  static std::size_t cell_at(const PyramidLevel& picture, const Eigen::Vector2f& pixel, const Eigen::Vector2f& motion);

  std::array<std::array<Cell, kCells>, 2> halves_{};  ///< by the host of the points, every second keyframe
};

}  // namespace tileflight::odometry
