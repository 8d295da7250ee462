#pragma once

// Points that left the window, and the cloud that is made of them.

#include <map>
#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/odometry/keyframe.h"
#include "tileflight/odometry/options.h"

namespace tileflight::odometry {

/// A point by its host keyframe, so that it follows the keyframe's last pose.
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
  std::vector<int> seen_by;  ///< ids of other keyframes in which its residual was good when it left
};

/// `residual_variance`: of a good residual, squared grey values; turns information into variance.
MapPoint map_point(const ActivePoint& point, int keyframe, double residual_variance);

/// Ids of the keyframes in which a point of the window has a good residual.
std::vector<int> keyframes_seeing(const ActivePoint& point, const Window& window);

/// Whether a point passes the options' filters.
bool is_clean(const MapPoint& point, const MapOptions& options);

/// Positions in the map frame with colours and the scalars inverse_depth_variance (along the host's ray), observations,
/// first_frame, last_frame and keyframe (which of `T_map_keyframe`, in order, hosts it: the line of keyframes.txt);
/// only points that pass the options' filters. In the order of `points`.
geometry::PointCloud make_cloud(const std::vector<MapPoint>& points, const std::map<int, SE3>& T_map_keyframe,
                                const MapOptions& options);

/// For each point of make_cloud(): positions in `keyframes` (ids, ascending) of its host and of those that saw it.
std::vector<std::vector<int>> make_tracks(const std::vector<MapPoint>& points, const std::vector<int>& keyframes,
                                          const MapOptions& options);

}  // namespace tileflight::odometry
