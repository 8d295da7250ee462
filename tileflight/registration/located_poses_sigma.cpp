#include "tileflight/registration/located_poses_sigma.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/alignment/jackknife.h"
#include "tileflight/alignment/pose_alignment.h"

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

double similarity_sigma_m(const std::vector<LocatedPose>& poses, const alignment::PointSpread& points,
                          PathCoverage coverage) {
  const std::size_t most_groups = coverage == PathCoverage::kWhole ? 10 : 8;  // of twenty: of two each, equally many
  const std::size_t groups = std::min(most_groups, poses.size() / 2);
  if (groups < 2) return std::numeric_limits<double>::quiet_NaN();
  std::vector<Sim3> without;
  for (std::size_t group = 0; group < groups; ++group) {
    std::vector<LocatedPose> rest;
    for (std::size_t i = 0; i < poses.size(); ++i)
      if (i * groups / poses.size() != group) rest.push_back(poses[i]);
    without.push_back(similarity_of(rest));
  }
  constexpr std::size_t kFewestGroups = 4;
  if (coverage == PathCoverage::kParts || groups < kFewestGroups)
    return alignment::jackknife_sigma_m(similarity_of(poses), groups, points,
                                        [&](std::size_t g) { return without[g]; });
  const auto squared_motion = [&](std::size_t a, std::size_t b) {
    return std::pow(alignment::rms_motion_m(without[a], without[b], points), 2);
  };
  double squares = 0.0;  // of second differences: |a - 2 b + c|^2 = 2 |a - b|^2 + 2 |b - c|^2 - |a - c|^2
  for (std::size_t g = 2; g < groups; ++g)
    squares += 2.0 * squared_motion(g - 2, g - 1) + 2.0 * squared_motion(g - 1, g) - squared_motion(g - 2, g);
  const auto n = static_cast<double>(groups);
  return (n - 1.0) * std::sqrt(std::max(0.0, squares) / (6.0 * n * (n - 2.0)));
}

}  // namespace tileflight::registration
