#pragma once

#include <vector>

#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::alignment {

/// A map's points and how they were seen. Map frame, map units.
struct ObservedPoints {
  std::vector<geometry::Vec3> positions;
  /// Camera centre that each point's distance was measured from; empty where the map does not say.
  std::vector<geometry::Vec3> viewpoints;
  /// Standard deviation of that distance as a share of it; empty where the map does not say.
  std::vector<double> distance_sigma;
  /// Which viewpoint it is (points of one keyframe share its errors); empty where the map does not say.
  std::vector<std::size_t> keyframe;

  std::size_t size() const { return positions.size(); }
  bool has_viewpoints() const { return !viewpoints.empty(); }
};

/// From the scalars `keyframe` and `inverse_depth_variance` of map.ply and the keyframes' poses (T_map_camera); what is
/// missing, or does not fit together, is left empty.
ObservedPoints observed_points(const geometry::PointCloud& map, const geometry::Trajectory& keyframes);

/// Every k-th point, with k the least that leaves at most about `most`.
ObservedPoints thinned(const ObservedPoints& points, std::size_t most);

}  // namespace tileflight::alignment
