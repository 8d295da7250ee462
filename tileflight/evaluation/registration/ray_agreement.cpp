#include "tileflight/evaluation/registration/ray_agreement.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace tileflight::registration {

using geometry::Vec3;

namespace {

enum class RayOutcome { kAgrees, kBlocked, kFloating, kNotCounted };

struct RayResult {
  RayOutcome outcome = RayOutcome::kNotCounted;
  double score = 0.0;
};

RayResult cast_through_point(const ObservedPoints& points, std::size_t i, const geometry::Sim3& T, const RayCast& cast,
                             const RayAgreementOptions& options) {
  const Vec3 eye = T * points.viewpoints[i], point = T * points.positions[i];
  const auto counts = [&](const geometry::Box3& box) { return box.contains(point); };
  if (!options.regions.empty() && std::ranges::none_of(options.regions, counts)) return {};
  const double distance_m = (point - eye).norm();
  if (!(distance_m > 0.0) || !std::isfinite(distance_m)) return {};
  constexpr double kSigmas = 3.0, kReach = 1.5, kClearly = 2.0;
  const double sigma = points.distance_sigma.empty() ? 0.0 : points.distance_sigma[i];
  const double tolerance = std::max(options.min_tolerance, kSigmas * sigma);
  const auto met_m = cast(eye, (point - eye) / distance_m, kReach * distance_m);
  if (!met_m) return {RayOutcome::kFloating, 0.0};
  const double deviation = std::log(*met_m / distance_m) / tolerance;
  if (deviation < -kClearly) return {RayOutcome::kBlocked, -1.0};
  if (std::abs(deviation) > 1.0) return {RayOutcome::kFloating, 0.0};
  return {RayOutcome::kAgrees, 1.0 - deviation * deviation};
}

}  // namespace

std::optional<RayAgreement> compute_ray_agreement(const ObservedPoints& points, const geometry::Sim3& T_local_map,
                                                  const RayCast& cast, const RayAgreementOptions& options) {
  if (!points.has_viewpoints()) return std::nullopt;
  const std::size_t stride = std::max<std::size_t>(1, (points.size() + options.max_rays - 1) / options.max_rays);
  std::vector<RayResult> results((points.size() + stride - 1) / stride);
  tbb::parallel_for(std::size_t{0}, results.size(), [&](std::size_t k) {
    results[k] = cast_through_point(points, k * stride, T_local_map, cast, options);
  });
  RayAgreement agreement;
  std::map<std::size_t, std::pair<double, double>> keyframes;
  double sum = 0.0, agreeing = 0.0, blocked = 0.0, floating = 0.0;
  for (std::size_t k = 0; k < results.size(); ++k) {
    if (results[k].outcome == RayOutcome::kNotCounted) continue;
    ++agreement.rays;
    sum += results[k].score;
    agreeing += results[k].outcome == RayOutcome::kAgrees ? 1.0 : 0.0;
    blocked += results[k].outcome == RayOutcome::kBlocked ? 1.0 : 0.0;
    floating += results[k].outcome == RayOutcome::kFloating ? 1.0 : 0.0;
    auto& [total, count] = keyframes[points.keyframe[k * stride]];
    total += results[k].score;
    count += 1.0;
  }
  if (agreement.rays == 0) return std::nullopt;
  const auto n = static_cast<double>(agreement.rays);
  agreement.score = sum / n;
  agreement.agreeing_share = agreeing / n;
  agreement.blocked_share = blocked / n;
  agreement.floating_share = floating / n;
  for (const auto& [keyframe, of] : keyframes) agreement.keyframe_scores.push_back(of.first / of.second);
  return agreement;
}

}  // namespace tileflight::registration
