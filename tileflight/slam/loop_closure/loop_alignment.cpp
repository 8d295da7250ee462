#include "tileflight/slam/loop_closure/loop_alignment.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/slam/mapping/host_target_pairs.h"
#include "tileflight/slam/tracking/tracker.h"

namespace tileflight::loop_closure {

std::vector<float> PixelGrid::rho_within(const Eigen::Vector2f& pixel, float radius_px) const {
  std::vector<float> out;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      const auto cell = cells_.find(key(pixel + kCell_px * Eigen::Vector2f(dx, dy)));
      if (cell == cells_.end()) continue;
      for (const KnownPixel& known : cell->second) {
        if ((known.pixel - pixel).norm() < radius_px) out.push_back(known.rho);
      }
    }
  }
  return out;
}

std::pair<int, int> PixelGrid::key(const Eigen::Vector2f& pixel) {
  return {static_cast<int>(std::floor(pixel.x() / kCell_px)), static_cast<int>(std::floor(pixel.y() / kCell_px))};
}

namespace {

using geometry::Mat6;
using geometry::SE3;
using geometry::Sim3;
using geometry::Vec3;
using geometry::Vec6;
using mapping::MapPoint;

/// Errors of neighbouring residuals, and of points side by side, depend on each other, so that sigmas from independent
/// ones are too small by these factors: medians over 16 flights of benchmarks/loop_accuracy.py against their true
/// poses.
constexpr double kPoseInflation = 1.7, kLogScaleInflation = 2.3;

/// Points whose inverse distance is known better than this, and how many of them a keyframe needs. Chosen by hand.
constexpr float kMostRelativeSigma = 0.1F;
constexpr std::size_t kFewestPoints = 60;

std::vector<const MapPoint*> known_points(const std::vector<const MapPoint*>& points) {
  std::vector<const MapPoint*> known;
  for (const MapPoint* point : points) {
    if (point->rho > 0 && std::sqrt(point->rho_variance) < kMostRelativeSigma * point->rho) known.push_back(point);
  }
  return known;
}

/// A keyframe's picture and points, ready for an alignment.
struct PreparedKeyframe {
  keyframes::Pyramid pyramid;
  std::vector<const MapPoint*> points;
  tracking::TrackingReference reference;
};

std::optional<PreparedKeyframe> prepare(const keyframes::LensPyramid& lens, const AlignedKeyframe& keyframe) {
  PreparedKeyframe out{
      restore_pyramid(*keyframe.image, static_cast<int>(lens.lenses.size())), known_points(keyframe.points), {}};
  if (out.points.size() < kFewestPoints) return std::nullopt;
  std::vector<tracking::ReferencePoint> pixels;
  for (const MapPoint* point : out.points) {
    Eigen::Vector2f pixel;
    if (lens.lenses[0].project<float>(point->ray, pixel))
      pixels.push_back({pixel, point->rho, 1.0F / std::sqrt(point->rho_variance)});
  }
  out.reference = tracking::make_tracking_reference(lens, out.pyramid, pixels);
  return out;
}

std::optional<AlignedPose> align(const keyframes::LensPyramid& lens, const PreparedKeyframe& a,
                                 const PreparedKeyframe& b, const SE3& T_a_b) {
  // Shares of the points that must be in view, and may be something else there. Chosen by hand.
  constexpr double kLeastInside = 0.25, kMostSaturated = 0.4;
  const tracking::ImageAlignment found =
      tracking::align_image(lens, a.reference, b.pyramid, {T_a_b.inverse(), 0.0, 0.0}, {});
  if (!found.converged || found.inside_share < kLeastInside || found.saturated_share > kMostSaturated)
    return std::nullopt;
  // A left twist of T_b_a is, but for its sign, a right twist of T_a_b.
  return AlignedPose{found.state.T_target_reference.inverse(),
                     kPoseInflation * kPoseInflation * tracking::pose_covariance(found)};
}

struct LogScale {
  double value = 0.0, variance = 0.0;
};

/// Median over b's points of the logarithm of their distance by a's points beside them over their own.
std::optional<LogScale> compare_distances(const keyframes::LensPyramid& lens, const PreparedKeyframe& a,
                                          const PreparedKeyframe& b, const SE3& T_a_b) {
  constexpr float kRadius_px = 2.0F;  // of the kept level
  constexpr std::size_t kFewestPairs = 20;
  constexpr double kLeastSigma = 0.001;  // all three chosen by hand
  PixelGrid grid;                        // a's points in b
  const SE3 T_b_a = T_a_b.inverse();
  for (const MapPoint* point : a.points) {
    const Vec3 X = T_b_a.rotation * point->ray.cast<double>() + static_cast<double>(point->rho) * T_b_a.translation;
    Eigen::Vector2f pixel;
    if (lens.lenses[0].project<float>(X.cast<float>(), pixel))
      grid.add({pixel, static_cast<float>(point->rho / X.norm())});
  }
  std::vector<double> logs;
  for (const MapPoint* point : b.points) {
    Eigen::Vector2f pixel;
    if (!lens.lenses[0].project<float>(point->ray, pixel)) continue;
    for (const float rho : grid.rho_within(pixel, kRadius_px)) logs.push_back(std::log(point->rho / rho));
  }
  if (logs.size() < kFewestPairs) return std::nullopt;
  LogScale out{.value = base::upper_median(logs)};
  for (double& value : logs) value = std::abs(value - out.value);
  // The sigma is that of a normal distribution with this median deviation. Neighbouring points agree only as far as the
  // ground is flat.
  const double sigma = std::max(kLeastSigma, 1.4826 * base::upper_median(logs));
  // That of a median is pi / 2 times that of a mean.
  out.variance = kLogScaleInflation * kLogScaleInflation * 0.5 * std::numbers::pi * sigma * sigma /
                 static_cast<double>(logs.size());
  return out;
}

}  // namespace

std::optional<LoopAlignment> align_loop(const keyframes::LensPyramid& full_lens, const AlignedKeyframe& keyframe_a,
                                        const AlignedKeyframe& keyframe_b, const Sim3& T_a_b) {
  const keyframes::LensPyramid lens = lens_from_level(full_lens, keyframe_a.image->level);
  const auto a = prepare(lens, keyframe_a), b = prepare(lens, keyframe_b);
  if (!a || !b) return std::nullopt;
  const SE3 by_a(T_a_b.rotation, T_a_b.translation);
  const SE3 by_b = SE3(T_a_b.rotation, T_a_b.translation / T_a_b.scale).inverse();
  const auto a_b = align(lens, *a, *b, by_a), b_a = align(lens, *b, *a, by_b);
  if (!a_b || !b_a) return std::nullopt;
  const auto scale = compare_distances(lens, *a, *b, a_b->T_a_b);
  if (!scale) return std::nullopt;
  const LoopAlignment alignment{*a_b, *b_a, scale->value, scale->variance};
  // Ten standard deviations: where a camera's row times or exposures are not known, each flight's own disagreement
  // tells what the sigmas are worth (measure_consistency()). Chosen by hand.
  constexpr double kMostDisagreement = 100.0;
  return disagreement(alignment) < kMostDisagreement ? std::optional(alignment) : std::nullopt;
}

double disagreement(const LoopAlignment& alignment) {
  // b_a in units of a: its translation, and what that is known to, are stretched; how far is known to the scale's
  // sigma.
  const double scale = std::exp(alignment.log_scale);
  const SE3 T_a_b = alignment.a_b.T_a_b;
  const SE3 T_b_a(alignment.b_a.T_a_b.rotation, scale * alignment.b_a.T_a_b.translation);
  Vec6 stretched = Vec6::Ones();
  stretched.head<3>().setConstant(scale);
  Vec6 by_log_scale = Vec6::Zero();
  by_log_scale.head<3>() = T_a_b.rotation * T_b_a.translation;
  const Mat6 carried = mapping::adjoint(T_b_a.inverse());
  const Mat6 covariance = carried * alignment.a_b.covariance * carried.transpose() +
                          stretched.asDiagonal() * alignment.b_a.covariance * stretched.asDiagonal() +
                          alignment.log_scale_variance * by_log_scale * by_log_scale.transpose();
  const Vec6 off = (T_a_b * T_b_a).log();
  return off.dot(geometry::solve_symmetric(covariance, off)) / 6.0;
}

}  // namespace tileflight::loop_closure
