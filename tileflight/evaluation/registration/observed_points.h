#pragma once

#include <vector>

#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::registration {

/// Points of a map with their viewpoints and uncertainty. Map frame, map units.
struct ObservedPoints {
  std::vector<geometry::Vec3> positions;
  /// Camera centre from which each point's distance was measured; empty if unknown.
  std::vector<geometry::Vec3> viewpoints;
  /// Relative standard deviation of that distance; empty if unknown.
  std::vector<double> distance_sigma;
  /// Index of the viewpoint (points of one keyframe have common errors); empty if unknown.
  std::vector<std::size_t> keyframe;

  std::size_t size() const { return positions.size(); }
  bool has_viewpoints() const { return !viewpoints.empty(); }
};

/// Makes observed points from the scalars `keyframe` and `inverse_depth_variance` of map.ply and the keyframes' poses
/// (T_map_camera). Members whose data are missing or inconsistent are left empty.
ObservedPoints make_observed_points(const geometry::PointCloud& map, const geometry::Trajectory& keyframes);

/// Returns every k-th point, with the smallest k that leaves at most about `most` points.
ObservedPoints subsample(const ObservedPoints& points, std::size_t most);

}  // namespace tileflight::registration
