#include "tileflight/slam/tracking/relocalization.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace tileflight::tracking {

double correlation(const keyframes::LensPyramid& lens, const TrackingReference& reference,
                   const keyframes::Pyramid& target, const geometry::SE3& T) {
  const ReferenceLevel& level = reference.levels[0];
  const keyframes::PyramidLevel& picture = target.levels[0];
  const Eigen::Matrix3f R = T.rotation.toRotationMatrix().cast<float>();
  const Eigen::Vector3f t = T.translation.cast<float>();
  std::vector<std::pair<double, double>> pairs;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  for (std::size_t i = 0; i < level.size(); ++i) {
    Eigen::Vector2f pixel;
    if (!lens.lenses[0].project<float>(R * level.ray_of(i) + level.rho[i] * t, pixel)) continue;
    if (!picture.inside(pixel.x(), pixel.y(), 2.0F)) continue;
    const float seen = picture.sample(pixel.x(), pixel.y())[static_cast<int>(keyframes::kIntensity)];
    pairs.emplace_back(level.intensity[i], seen);
    mean += Eigen::Vector2d(level.intensity[i], seen);
  }
  if (pairs.size() < 3) return 0.0;
  mean /= static_cast<double>(pairs.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  for (const auto& [expected, seen] : pairs) {
    const Eigen::Vector2d d = Eigen::Vector2d(expected, seen) - mean;
    spread += d * d.transpose();
  }
  const double contrast = std::sqrt(spread(0, 0) * spread(1, 1));
  return contrast > 0.0 ? spread(0, 1) / contrast : 0.0;
}

namespace {

using geometry::SE3;
using geometry::Vec3;

// Chosen by hand.
constexpr double kMinInsideShare = 0.3;

/// Rotations around a keyframe's orientation, spaced so that the coarsest level converges from the nearest one: about
/// the image axes, and farther about the optical axis, about which a vehicle's turn rotates a camera that looks down
/// (one that looks ahead and down by a part about each). The spacing is chosen by hand.
std::vector<SE3> rotation_offsets() {
  constexpr double kStep_rad = 0.12;
  constexpr int kSteps = 2, kRolls = 4;
  std::vector<SE3> out;
  for (int y = -kSteps; y <= kSteps; ++y) {
    for (int x = -kSteps; x <= kSteps; ++x)
      out.emplace_back(geometry::so3_exp(kStep_rad * Vec3(x, y, 0)), Vec3::Zero());
    for (int z = -kRolls; z <= kRolls; ++z)
      if (z != 0) out.emplace_back(geometry::so3_exp(kStep_rad * Vec3(0, y, z)), Vec3::Zero());
  }
  return out;
}

}  // namespace

std::optional<Relocalization> relocalize(const keyframes::LensPyramid& lens,
                                         const std::vector<TrackingReference>& references,
                                         const keyframes::Pyramid& target, double accepted_rmse,
                                         const keyframes::TrackingOptions& options) {
  constexpr std::size_t kRefined = 5;
  if (references.empty()) return std::nullopt;
  const std::vector<SE3> starts = rotation_offsets();
  const int coarsest = static_cast<int>(target.levels.size()) - 1;
  std::vector<Relocalization> tried(references.size() * starts.size());
  tbb::parallel_for(std::size_t{0}, tried.size(), [&](std::size_t i) {
    tried[i].keyframe = i / starts.size();
    tried[i].alignment = align_image(lens, references[tried[i].keyframe], target, {starts[i % starts.size()], 0.0, 0.0},
                                     options, {}, coarsest);
  });
  std::erase_if(tried, [](const Relocalization& r) { return r.alignment.inside_share < kMinInsideShare; });
  std::stable_sort(tried.begin(), tried.end(), [coarsest](const Relocalization& a, const Relocalization& b) {
    return a.alignment.rmse[coarsest] < b.alignment.rmse[coarsest];
  });
  std::optional<Relocalization> best;
  for (std::size_t i = 0; i < std::min(kRefined, tried.size()); ++i) {
    const ImageAlignment refined =
        align_image(lens, references[tried[i].keyframe], target, tried[i].alignment.state, options);
    if (!refined.converged || refined.inside_share < kMinInsideShare || refined.finest_rmse() > accepted_rmse) continue;
    if (correlation(lens, references[tried[i].keyframe], target, refined.state.T_target_reference) < kMinCorrelation)
      continue;
    if (!best || refined.finest_rmse() < best->alignment.finest_rmse()) best = {tried[i].keyframe, refined};
  }
  return best;
}

}  // namespace tileflight::tracking
