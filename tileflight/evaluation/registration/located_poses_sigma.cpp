#include "tileflight/evaluation/registration/located_poses_sigma.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/alignment/uncertainty.h"

namespace tileflight::registration {

using geometry::SE3;
using geometry::Sim3;

Sim3 similarity_of(const std::vector<LocatedPose>& poses) {
  std::vector<SE3> in_map, found;
  for (const LocatedPose& pose : poses) {
    in_map.push_back(pose.T_map_camera);
    found.push_back(pose.T_local_camera);
  }
  return alignment::fit_poses(in_map, found);
}

namespace {

/// Similarities without each of `groups` intervals of the path.
std::vector<Sim3> leave_out_intervals(const std::vector<LocatedPose>& poses, std::size_t groups) {
  std::vector<Sim3> without;
  for (std::size_t group = 0; group < groups; ++group) {
    std::vector<LocatedPose> rest;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (i * groups / poses.size() != group) rest.push_back(poses[i]);
    without.push_back(similarity_of(rest));
  }
  return without;
}

/// By the second differences of `without`, of which there are three or more.
double contrast_sigma_m(const std::vector<Sim3>& without, const alignment::PointSpread& points) {
  const auto squared_motion = [&](std::size_t a, std::size_t b) {
    return std::pow(alignment::rms_motion_m(without[a], without[b], points), 2);
  };
  double squares = 0.0;  // |a - 2 b + c|^2 = 2 |a - b|^2 + 2 |b - c|^2 - |a - c|^2
  for (std::size_t g = 2; g < without.size(); ++g)
    squares += 2.0 * squared_motion(g - 2, g - 1) + 2.0 * squared_motion(g - 1, g) - squared_motion(g - 2, g);
  const auto n = static_cast<double>(without.size());
  return (n - 1.0) * std::sqrt(std::max(0.0, squares) / (6.0 * n * (n - 2.0)));
}

}  // namespace

double similarity_sigma_m(const std::vector<LocatedPose>& poses, const alignment::PointSpread& points,
                          PathCoverage coverage) {
  constexpr std::size_t kMostGroups = 8, kMostContrasts = 10, kFewestContrasts = 4;  // ten: of twenty poses two each
  constexpr double kShared = 2.0;  // errors that are shared for longer than an interval; from the proving ground
  const std::size_t groups = std::min(kMostGroups, poses.size() / 2);
  if (groups < 2) return std::numeric_limits<double>::quiet_NaN();
  const std::vector<Sim3> without = leave_out_intervals(poses, groups);
  const double jackknife_m = alignment::jackknife_sigma_m(similarity_of(poses), groups, points,
                                                          [&](std::size_t group) { return without[group]; });
  const std::size_t contrasts = std::min(kMostContrasts, poses.size() / 2);
  if (coverage == PathCoverage::kParts || contrasts < kFewestContrasts) return jackknife_m;
  return std::min(jackknife_m, kShared * contrast_sigma_m(leave_out_intervals(poses, contrasts), points));
}

}  // namespace tileflight::registration
