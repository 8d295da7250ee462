#pragma once

// Map points that left the window, and the point cloud made from them.

#include <map>
#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/slam/keyframes/keyframe.h"
#include "tileflight/slam/keyframes/options.h"

namespace tileflight::mapping {

/// A point relative to its host keyframe, so that it follows the keyframe's final pose.
struct MapPoint {
  int keyframe = 0;     ///< id of the host
  Eigen::Vector3f ray;  ///< unit, host frame
  float rho = 0.0F;
  float rho_variance = 0.0F;
  float parallax_rad = 0.0F;
  int observations = 0;
  std::int64_t first_frame = 0;
  std::int64_t last_frame = 0;
  std::array<std::uint8_t, 3> color{};
  std::vector<int> observing_keyframes;  ///< ids of the other keyframes with a good residual when the point left the
                                         ///< window
};

/// Makes a map point. `residual_variance`: variance of a good residual, squared grey values; it converts the point's
/// information to a variance.
MapPoint make_map_point(const keyframes::ActivePoint& point, int keyframe, double residual_variance);

/// Ids of the keyframes in which an active point has a good residual.
std::vector<int> find_observing_keyframes(const keyframes::ActivePoint& point, const keyframes::Window& window);

/// Returns whether a point passes the options' filters.
bool passes_filters(const MapPoint& point, const keyframes::MapOptions& options);

/// Positions in the map frame with colours and the scalars inverse_depth_variance (along the host's ray), observations,
/// first_frame, last_frame and keyframe (index of the host in `T_map_keyframe`: its line in keyframes.txt). Contains
/// only points that pass the options' filters, in the order of `points`.
geometry::PointCloud make_point_cloud(const std::vector<MapPoint>& points,
                                      const std::map<int, geometry::SE3>& T_map_keyframe,
                                      const keyframes::MapOptions& options);

/// Returns for each point of make_point_cloud() the indices into `keyframes` (ids, ascending) of its host and of the
/// keyframes that observe it.
std::vector<std::vector<int>> make_point_tracks(const std::vector<MapPoint>& points, const std::vector<int>& keyframes,
                                                const keyframes::MapOptions& options);

}  // namespace tileflight::mapping
