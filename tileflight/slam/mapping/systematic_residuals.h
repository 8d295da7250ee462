#pragma once

// Detects from the images alone whether the calibration fits the camera. A slightly wrong lens model displaces image
// points. Poses and distances absorb the part that looks like motion; the rest stays in the residuals and is the same
// at the same place in the image for the same direction of motion. Noise does not repeat, so what two halves of the
// keyframes have in common comes from the lens, the shutter, or wrong geometry (a false initialization).

#include <array>
#include <optional>

#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/lens.h"
#include "tileflight/slam/mapping/systematic_displacement.h"

namespace tileflight::mapping {

class SystematicResiduals {
 public:
  /// Adds the good residuals in a window's keyframe, linearised at the present state.
  void add(const keyframes::Window& window, int slot, const keyframes::Lens& lens);
  /// Returns the displacement that both halves of the points have in common; nullopt if the halves share too few cells
  /// (image region and direction of motion).
  std::optional<SystematicDisplacement> estimate() const;

 private:
  static constexpr int kColumns = 8, kRows = 6, kDirections = 8, kCells = kColumns * kRows * kDirections;

  /// Weighted least-squares sums for one displacement.
  struct Cell {
    double information = 0.0;
    double pull = 0.0;  ///< information times displacement
    int residuals = 0;
  };
  static std::size_t cell_index(const keyframes::PyramidLevel& picture, const Eigen::Vector2f& pixel,
                                const Eigen::Vector2f& motion);

  std::array<std::array<Cell, kCells>, 2> halves_{};  ///< points split by host: even and odd keyframes
};

}  // namespace tileflight::mapping
