#include "tileflight/slam/mapping/map.h"

#include <algorithm>
#include <cmath>

namespace tileflight::mapping {
namespace {

/// Index of an id in an ascending list; -1 if it is not in it.
int index_of_id(int id, const std::vector<int>& ids) {
  const auto at = std::lower_bound(ids.begin(), ids.end(), id);
  return at != ids.end() && *at == id ? static_cast<int>(at - ids.begin()) : -1;
}

}  // namespace

bool passes_filters(const MapPoint& point, const keyframes::MapOptions& options) {
  return point.rho > 0 && point.observations >= options.min_observations &&
         std::sqrt(point.rho_variance) <= options.max_relative_sigma * point.rho &&
         point.parallax_rad >= options.min_parallax_rad;
}

std::vector<int> find_observing_keyframes(const keyframes::ActivePoint& point, const keyframes::Window& window) {
  std::vector<int> ids;
  for (const keyframes::Observation& observation : point.observations) {
    if (observation.state == keyframes::ResidualState::kGood) ids.push_back(window.keyframes[observation.target].id);
  }
  return ids;
}

MapPoint make_map_point(const keyframes::ActivePoint& point, int keyframe, double residual_variance) {
  MapPoint out;
  out.keyframe = keyframe;
  out.ray = point.patch.ray;
  out.rho = point.rho;
  out.rho_variance = static_cast<float>(residual_variance / std::max(point.information, 1e-6F));
  out.parallax_rad = point.parallax_rad;
  out.observations = point.good_observations;
  out.first_frame = point.first_frame;
  out.last_frame = point.last_frame;
  out.color = point.color;
  return out;
}

geometry::PointCloud make_point_cloud(const std::vector<MapPoint>& points,
                                      const std::map<int, geometry::SE3>& T_map_keyframe,
                                      const keyframes::MapOptions& options) {
  geometry::PointCloud cloud;
  std::vector<float>& variance = cloud.scalars["inverse_depth_variance"];
  std::vector<float>& observations = cloud.scalars["observations"];
  std::vector<float>& first = cloud.scalars["first_frame"];
  std::vector<float>& last = cloud.scalars["last_frame"];
  std::vector<float>& host = cloud.scalars["keyframe"];
  for (const MapPoint& point : points) {
    const auto pose = T_map_keyframe.find(point.keyframe);
    if (pose == T_map_keyframe.end() || !passes_filters(point, options)) continue;
    cloud.positions.push_back(pose->second * (point.ray.cast<double>() / point.rho));
    cloud.colors.push_back(point.color);
    variance.push_back(point.rho_variance);
    observations.push_back(static_cast<float>(point.observations));
    first.push_back(static_cast<float>(point.first_frame));
    last.push_back(static_cast<float>(point.last_frame));
    host.push_back(static_cast<float>(std::distance(T_map_keyframe.begin(), pose)));
  }
  return cloud;
}

std::vector<std::vector<int>> make_point_tracks(const std::vector<MapPoint>& points, const std::vector<int>& keyframes,
                                                const keyframes::MapOptions& options) {
  std::vector<std::vector<int>> tracks;
  for (const MapPoint& point : points) {
    const int host = index_of_id(point.keyframe, keyframes);
    if (host < 0 || !passes_filters(point, options)) continue;
    std::vector<int> track{host};
    for (const int id : point.observing_keyframes) {
      const int at = index_of_id(id, keyframes);
      if (at >= 0) track.push_back(at);
    }
    tracks.push_back(std::move(track));
  }
  return tracks;
}

}  // namespace tileflight::mapping
