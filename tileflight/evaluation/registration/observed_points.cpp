#include "tileflight/evaluation/registration/observed_points.h"

#include <algorithm>
#include <cmath>

namespace tileflight::registration {

namespace {

/// Relative sigma of a distance d whose inverse rho has the given variance: sigma_d / d = sigma_rho / rho, to first
/// order.
double relative_sigma(double distance, double inverse_variance) {
  constexpr double kMost = 0.5;  // upper limit: the distance is then practically unknown
  const double sigma = distance * std::sqrt(std::max(0.0, inverse_variance));
  return std::isfinite(sigma) ? std::min(sigma, kMost) : kMost;
}

template <class T>
std::vector<T> take_every(const std::vector<T>& values, std::size_t stride) {
  std::vector<T> sample;
  for (std::size_t i = 0; i < values.size(); i += stride) sample.push_back(values[i]);
  return sample;
}

}  // namespace

ObservedPoints make_observed_points(const geometry::PointCloud& map, const geometry::Trajectory& keyframes) {
  ObservedPoints points{.positions = map.positions};
  const auto hosts = map.scalars.find("keyframe");
  if (hosts == map.scalars.end()) return points;
  const auto is_known = [&](float host) {
    return host >= 0.0F && host < static_cast<float>(keyframes.size()) && host == std::floor(host);
  };
  if (!std::ranges::all_of(hosts->second, is_known)) return points;
  const auto variances = map.scalars.find("inverse_depth_variance");
  for (std::size_t i = 0; i < map.size(); ++i) {
    const auto host = static_cast<std::size_t>(hosts->second[i]);
    points.keyframe.push_back(host);
    points.viewpoints.push_back(keyframes.poses[host].T_local_camera.translation);
    if (variances == map.scalars.end()) continue;
    const double distance = (map.positions[i] - points.viewpoints.back()).norm();
    points.distance_sigma.push_back(relative_sigma(distance, variances->second[i]));
  }
  return points;
}

ObservedPoints subsample(const ObservedPoints& points, std::size_t most) {
  const std::size_t stride = std::max<std::size_t>(1, (points.size() + most - 1) / std::max<std::size_t>(1, most));
  if (stride == 1) return points;
  return {take_every(points.positions, stride), take_every(points.viewpoints, stride),
          take_every(points.distance_sigma, stride), take_every(points.keyframe, stride)};
}

}  // namespace tileflight::registration
