#include "tileflight/slam/mapping/densify.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>

#include "tileflight/slam/mapping/activation.h"

namespace tileflight::mapping {
namespace {

/// Whether a search found an unambiguous depth that no later search rejected.
bool has_clear_depth(const keyframes::ImmaturePoint& point, const keyframes::TracingOptions& options) {
  return point.has_depth() && point.rho() > 0 && point.failed_searches == 0 && point.quality > options.min_quality;
}

/// Angle at the point between the host's centre and a target's.
float parallax_rad(const keyframes::ActivePoint& point, const geometry::SE3& T_host_target) {
  const Eigen::Vector3d at = point.patch.ray.cast<double>() / point.rho;
  const Eigen::Vector3d from_target = at - T_host_target.translation;
  return static_cast<float>(std::atan2(at.cross(from_target).norm(), at.dot(from_target)));
}

void fill_statistics(const keyframes::Window& window, int host, keyframes::ActivePoint& point) {
  const geometry::SE3 T_host_map = window.keyframes[host].T_camera_map();
  point.good_observations = static_cast<int>(point.observations.size());
  for (const keyframes::Observation& observation : point.observations) {
    const keyframes::Keyframe& target = window.keyframes[observation.target];
    point.first_frame = std::min(point.first_frame, target.frame_index);
    point.last_frame = std::max(point.last_frame, target.frame_index);
    point.parallax_rad =
        std::max(point.parallax_rad, parallax_rad(point, T_host_map * target.T_camera_map().inverse()));
  }
}

}  // namespace

std::vector<keyframes::ActivePoint> densify_keyframe(const keyframes::Window& window, const keyframes::Lens& lens,
                                                      int host, const keyframes::OdometryOptions& options) {
  const keyframes::Keyframe& keyframe = window.keyframes[host];
  std::vector<const keyframes::ImmaturePoint*> candidates;
  for (const auto* points : {&keyframe.out_of_view, &keyframe.immature}) {
    for (const keyframes::ImmaturePoint& point : *points) {
      if (has_clear_depth(point, options.tracing)) candidates.push_back(&point);
    }
  }
  const std::vector<keyframes::PairTransform> pairs = pair_transforms_from(window, host);
  std::vector<std::optional<keyframes::ActivePoint>> fitted(candidates.size());
  tbb::parallel_for(std::size_t{0}, candidates.size(), [&](std::size_t i) {
    fitted[i] = try_activation(window, lens, host, pairs, *candidates[i], options.window, options.map.min_observations);
    if (fitted[i]) fill_statistics(window, host, *fitted[i]);
  });
  std::vector<keyframes::ActivePoint> points;
  for (std::optional<keyframes::ActivePoint>& point : fitted) {
    if (point) points.push_back(std::move(*point));
  }
  return points;
}

}  // namespace tileflight::mapping
