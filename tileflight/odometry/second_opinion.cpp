#include "tileflight/odometry/second_opinion.h"

#include <algorithm>
#include <cmath>

#include "tileflight/odometry/known_start.h"

namespace tileflight::odometry {

std::optional<Agreement> agreement(const geometry::Trajectory& first, const geometry::Trajectory& second,
                                   std::size_t least) {
  constexpr double kSameTime_s = 1e-6;
  const auto pairs = geometry::associate(first, second, kSameTime_s);
  if (pairs.size() < least) return std::nullopt;
  std::vector<geometry::SE3> from, to;
  for (const auto& [a, b] : pairs) {
    from.push_back(second.poses[b].T_local_camera);
    to.push_back(first.poses[a].T_local_camera);
  }
  const auto similarity = similarity_of_poses(from, to);
  if (!similarity || !(similarity->scale > 0.0)) return std::nullopt;
  Agreement result{.pictures = pairs.size()};
  double path = 0.0, path_moved = 0.0, squares = 0.0, worst = 0.0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const double distance = (*similarity * from[i].translation - to[i].translation).norm();
    squares += distance * distance;
    if (i > 0) {
      path += (to[i].translation - to[i - 1].translation).norm();
      path_moved += similarity->scale * (from[i].translation - from[i - 1].translation).norm();
    }
    if (distance <= worst) continue;
    worst = distance;
    result.worst_time_s = first.poses[pairs[i].first].time_s;
  }
  path = std::min(path, path_moved);
  if (!(path > 0.0)) return std::nullopt;
  result.rms_share = std::sqrt(squares / static_cast<double>(pairs.size())) / path;
  result.worst_share = worst / path;
  return result;
}

}  // namespace tileflight::odometry
