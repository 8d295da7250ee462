#include "tileflight/odometry/densify.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

#include "tileflight/odometry/activation.h"

namespace tileflight::odometry {
namespace {

/// Found by a search that had one clear answer, and not refused by a later one.
bool is_found(const ImmaturePoint& point, const TracingOptions& options) {
  return point.has_depth() && point.rho() > 0 && point.failures == 0 && point.quality > options.min_quality;
}

/// Angle at the point between the host's centre and a target's.
float parallax_rad(const ActivePoint& point, const SE3& T_host_target) {
  const Eigen::Vector3d at = point.patch.ray.cast<double>() / point.rho;
  const Eigen::Vector3d from_target = at - T_host_target.translation;
  return static_cast<float>(std::atan2(at.cross(from_target).norm(), at.dot(from_target)));
}

void describe(const Window& window, int host, ActivePoint& point) {
  const SE3 T_host_map = window.keyframes[host].T_camera_map();
  point.good_observations = static_cast<int>(point.observations.size());
  for (const Observation& observation : point.observations) {
    const Keyframe& target = window.keyframes[observation.target];
    point.first_frame = std::min(point.first_frame, target.frame_index);
    point.last_frame = std::max(point.last_frame, target.frame_index);
    point.parallax_rad =
        std::max(point.parallax_rad, parallax_rad(point, T_host_map * target.T_camera_map().inverse()));
  }
}

}  // namespace

std::vector<ActivePoint> further_points(const Window& window, const Lens& lens, int host,
                                        const OdometryOptions& options) {
  const Keyframe& keyframe = window.keyframes[host];
  std::vector<const ImmaturePoint*> candidates;
  for (const auto* points : {&keyframe.out_of_view, &keyframe.immature}) {
    for (const ImmaturePoint& point : *points) {
      if (is_found(point, options.tracing)) candidates.push_back(&point);
    }
  }
  const std::vector<PairTransform> pairs = pairs_from(window, host);
  std::vector<std::optional<ActivePoint>> fitted(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    fitted[i] = try_activation(window, lens, host, pairs, *candidates[i], options.window, options.map.min_observations);
    if (fitted[i]) describe(window, host, *fitted[i]);
  });
  std::vector<ActivePoint> points;
  for (std::optional<ActivePoint>& point : fitted) {
    if (point) points.push_back(std::move(*point));
  }
  return points;
}

}  // namespace tileflight::odometry
