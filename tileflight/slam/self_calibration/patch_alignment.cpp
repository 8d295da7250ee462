#include "tileflight/slam/self_calibration/patch_alignment.h"

#include <cmath>

#include "tileflight/core/geometry/decompositions.h"

namespace tileflight::self_calibration {
namespace {

// Chosen by hand.
constexpr int kPatchSide = 2 * Patch::kRadius + 1;
constexpr int kAlignments = 12;
constexpr double kSettled_px = 0.01;
constexpr double kFarthest_px = 2.0;
constexpr double kShapeWeight = 900.0;      // (3 grey values / 0.1)^2: holds the shape of a patch with few gradients
constexpr double kLeastCorrelation = 0.85;  // of the values

using Unknowns = Eigen::Matrix<double, 8, 1>;  ///< of the shape, row by row, then the pixel, gain and offset

}  // namespace

Patch::Patch(const keyframes::PyramidLevel& image, int x, int y) {
  for (int v = -kRadius; v <= kRadius; ++v)
    for (int u = -kRadius; u <= kRadius; ++u) values_.push_back(image.intensity(x + u, y + v));
}

std::optional<PatchWarp> Patch::align(const keyframes::PyramidLevel& image, const PatchWarp& guess) const {
  PatchWarp warp = guess;
  double gain = 1.0, offset = 0.0;
  for (int round = 0; round < kAlignments; ++round) {
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(8, 8);
    Unknowns b = Unknowns::Zero();
    double seen_sum = 0.0, seen_square = 0.0, own_sum = 0.0, own_square = 0.0, mixed = 0.0;
    for (int i = 0; i < kPatchSide * kPatchSide; ++i) {
      const Eigen::Vector2d at(i % kPatchSide - kRadius, i / kPatchSide - kRadius);
      const Eigen::Vector2f place = (warp.pixel + warp.shape * at).cast<float>();
      if (!image.inside(place.x(), place.y(), 1.0F)) return std::nullopt;
      const keyframes::Texel texel = image.sample(place.x(), place.y());
      const double seen = texel[keyframes::kIntensity], own = values_[i];
      const double gx = texel[keyframes::kGradX], gy = texel[keyframes::kGradY];
      Unknowns row;
      row << gx * at.x(), gx * at.y(), gy * at.x(), gy * at.y(), gx, gy, -own, -1.0;
      H.selfadjointView<Eigen::Lower>().rankUpdate(row);
      b += row * (seen - gain * own - offset);
      seen_sum += seen, own_sum += own, mixed += seen * own, seen_square += seen * seen, own_square += own * own;
    }
    const double n = kPatchSide * kPatchSide;
    const double covariance = mixed - seen_sum * own_sum / n;
    const double deviations = std::sqrt((seen_square - seen_sum * seen_sum / n) * (own_square - own_sum * own_sum / n));
    for (int i = 0; i < 4; ++i) {
      H(i, i) += kShapeWeight;
      b[i] += kShapeWeight * (warp.shape(i / 2, i % 2) - guess.shape(i / 2, i % 2));
    }
    const Eigen::MatrixXd full = H.selfadjointView<Eigen::Lower>();
    const Eigen::VectorXd step = geometry::solve_symmetric(full, Eigen::VectorXd(-b));
    if (!step.allFinite() || step.segment<2>(4).norm() > kFarthest_px) return std::nullopt;
    for (int i = 0; i < 4; ++i) warp.shape(i / 2, i % 2) += step[i];
    warp.pixel += step.segment<2>(4);
    gain += step[6];
    offset += step[7];
    if ((warp.pixel - guess.pixel).norm() > kFarthest_px) return std::nullopt;
    if (step.segment<2>(4).norm() < kSettled_px)
      return covariance > kLeastCorrelation * deviations ? std::optional(warp) : std::nullopt;
  }
  return std::nullopt;
}

}  // namespace tileflight::self_calibration
