#include "tileflight/experiments/study/run_survival.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::study {
namespace {

using geometry::Vec3;

constexpr double kGap_s = 1.0, kGapSteps = 3.0;

/// Estimated and true positions of the poses that have a true one, with the distance flown.
struct PathPairs {
  std::vector<double> times_s, flown_m;
  std::vector<Vec3> estimated, exact;
};

/// Distance flown at each pose of the true path.
std::vector<double> distances_flown(const geometry::Trajectory& truth) {
  std::vector<double> flown(truth.size(), 0.0);
  for (std::size_t i = 1; i < truth.size(); ++i)
    flown[i] = flown[i - 1] +
               (truth.poses[i].T_local_camera.translation - truth.poses[i - 1].T_local_camera.translation).norm();
  return flown;
}

/// Distance flown at a time within the true path.
double flown_at(const geometry::Trajectory& truth, const std::vector<double>& flown, double time_s) {
  const auto after = std::ranges::upper_bound(truth.poses, time_s, {}, &geometry::StampedPose::time_s);
  if (after == truth.poses.begin()) return 0.0;
  if (after == truth.poses.end()) return flown.back();
  const auto next = static_cast<std::size_t>(after - truth.poses.begin());
  const double from_s = truth.poses[next - 1].time_s, to_s = truth.poses[next].time_s;
  return std::lerp(flown[next - 1], flown[next], (time_s - from_s) / (to_s - from_s));
}

PathPairs pair_up(const geometry::Trajectory& estimate, const geometry::Trajectory& truth,
                  const std::vector<double>& flown) {
  PathPairs pairs;
  for (const geometry::StampedPose& pose : estimate.poses) {
    const auto exact = geometry::interpolate(truth, pose.time_s);
    if (!exact || !pose.T_local_camera.translation.allFinite()) continue;
    pairs.times_s.push_back(pose.time_s);
    pairs.flown_m.push_back(flown_at(truth, flown, pose.time_s));
    pairs.estimated.push_back(pose.T_local_camera.translation);
    pairs.exact.push_back(exact->translation);
  }
  return pairs;
}

/// The longest time between two poses that is no gap.
double allowed_gap_s(const geometry::Trajectory& truth) {
  std::vector<double> steps_s;
  for (std::size_t i = 1; i < truth.size(); ++i) steps_s.push_back(truth.poses[i].time_s - truth.poses[i - 1].time_s);
  return steps_s.empty() ? kGap_s : std::max(kGap_s, kGapSteps * base::median(steps_s));
}

/// The distance at which a gap begins, the first one after the first pose.
std::optional<double> find_gap(const PathPairs& pairs, double end_s, double allowed_s) {
  for (std::size_t i = 0; i < pairs.times_s.size(); ++i) {
    const double next_s = i + 1 < pairs.times_s.size() ? pairs.times_s[i + 1] : end_s;
    if (next_s - pairs.times_s[i] > allowed_s) return pairs.flown_m[i];
  }
  return std::nullopt;
}

/// The distance at which the first stretch begins that does not fit the true path.
std::optional<double> find_break(const PathPairs& pairs, double stretch_m) {
  constexpr double kLargestRms = 0.05, kLargestScaleChange = 4.0 / 3.0;
  constexpr std::size_t kFewestPoses = 5;
  std::vector<double> scales;
  if (!(stretch_m > 0.0)) return std::nullopt;  // the vehicle stands still
  for (std::size_t from = 0; from < pairs.flown_m.size();) {
    std::size_t to = from;
    while (to < pairs.flown_m.size() && pairs.flown_m[to] < pairs.flown_m[from] + stretch_m) ++to;
    if (to == pairs.flown_m.size()) break;  // what remains is shorter than a stretch
    const auto part = [&](const std::vector<Vec3>& positions) {
      return std::vector<Vec3>(positions.begin() + static_cast<std::ptrdiff_t>(from),
                               positions.begin() + static_cast<std::ptrdiff_t>(to) + 1);
    };
    if (to - from + 1 >= kFewestPoses) {
      const std::vector<Vec3> estimated = part(pairs.estimated);
      // A path that stands still where the vehicle flies has no scale.
      const bool moves = std::ranges::any_of(
          estimated, [&](const Vec3& p) { return (p - estimated.front()).norm() > 1e-9 * (1.0 + p.norm()); });
      if (!moves) return pairs.flown_m[from];
      const alignment::UmeyamaResult fit = alignment::umeyama(estimated, part(pairs.exact));
      if (fit.rmse_m > kLargestRms * stretch_m) return pairs.flown_m[from];
      const double scale = fit.T_target_source.scale;
      if (!scales.empty()) {
        const double ratio = scale / base::median(scales);
        if (std::max(ratio, 1.0 / ratio) > kLargestScaleChange) return pairs.flown_m[from];
      }
      scales.push_back(scale);
    }
    from = to;
  }
  return std::nullopt;
}

}  // namespace

RunSurvival measure_survival(const geometry::Trajectory& estimate, const geometry::Trajectory& truth) {
  constexpr double kStretches = 10.0;
  const std::vector<double> flown = distances_flown(truth);
  if (truth.empty()) return {};
  const PathPairs pairs = pair_up(estimate, truth, flown);
  if (pairs.times_s.empty()) return {.distance_m = 0.0, .failed = true, .reason = "no pose"};
  RunSurvival result{.distance_m = flown.back(), .failed = false, .reason = {}};
  const double allowed_s = allowed_gap_s(truth);
  if (const auto gap = find_gap(pairs, truth.poses.back().time_s, allowed_s))
    result = {.distance_m = *gap, .failed = true, .reason = base::formatted("no pose for over %.3g s", allowed_s)};
  if (const auto broken = find_break(pairs, flown.back() / kStretches); broken && *broken < result.distance_m)
    result = {.distance_m = *broken, .failed = true, .reason = "a stretch of the path is wrong"};
  return result;
}

std::vector<SurvivalStep> survival_curve(std::vector<RunSurvival> runs) {
  std::ranges::sort(runs, {}, &RunSurvival::distance_m);
  std::vector<SurvivalStep> curve;
  double share = 1.0, greenwood = 0.0;
  for (std::size_t i = 0; i < runs.size();) {
    const double distance_m = runs[i].distance_m;
    const std::size_t at_risk = runs.size() - i;
    std::size_t failures = 0;
    for (; i < runs.size() && runs[i].distance_m == distance_m; ++i) failures += runs[i].failed;
    if (failures == 0) continue;
    const auto n = static_cast<double>(at_risk), d = static_cast<double>(failures);
    share *= 1.0 - d / n;
    greenwood += failures < at_risk ? d / (n * (n - d)) : 0.0;
    SurvivalStep step{.distance_m = distance_m, .share = share, .low = 0.0, .high = 1.0, .at_risk = at_risk};
    if (share > 0.0) {
      const double spread = metrics::kNormal975 * std::sqrt(greenwood) / std::log(share);  // negative
      step.low = std::pow(share, std::exp(-spread));
      step.high = std::pow(share, std::exp(spread));
    }
    curve.push_back(step);
  }
  return curve;
}

double share_at(const std::vector<SurvivalStep>& curve, double distance_m) {
  double share = 1.0;
  for (const SurvivalStep& step : curve) {
    if (step.distance_m <= distance_m) share = step.share;
  }
  return share;
}

nlohmann::json to_json(const std::vector<SurvivalStep>& curve) {
  nlohmann::json list = nlohmann::json::array();
  for (const SurvivalStep& step : curve)
    list.push_back({{"distance", step.distance_m},
                    {"share", step.share},
                    {"interval", {step.low, step.high}},
                    {"at_risk", step.at_risk}});
  return list;
}

}  // namespace tileflight::study
