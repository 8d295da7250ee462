#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::base {
class StrictSection;
}

namespace tileflight::metrics {

/// Box around a moving object, which the ground truth does not hold, at one moment.
struct PlacedBox {
  geometry::SE3 T_local_box;  ///< from its axes (forward, left, up; origin in its middle) to the local frame
  geometry::Vec3 size_m;      ///< along these axes
};

/// Margins that decide whether a point is on an object, rather than on the place around it.
struct BoxMargins {
  double grown_m = 0.2;   ///< beyond the sides and the top: what a map's noise carries outside
  double lifted_m = 0.3;  ///< above the bottom, at most a third of the height: what is lower may be the ground, and the
                          ///< truth has that surface near it
};

/// Returns whether the point (local frame) is on the object in the box.
bool is_on(const PlacedBox& box, const geometry::Vec3& point, const BoxMargins& margins = {});

/// Scores of some of a map's points. MapMetrics and SurfaceMetrics define the numbers.
struct PointScores {
  std::size_t points = 0;
  DistanceStatistics voxel;                   ///< of the points within the cut-off of a voxel centre
  std::optional<DistanceStatistics> surface;  ///< of the points over the region; nullopt without a true surface
};

/// Scores points by their distances to voxel centres and, for those over the region, to the surface.
PointScores score_points(const std::vector<double>& voxel_m, const std::optional<std::vector<double>>& surface_m,
                         double cutoff_m);

/// Points on moving things, counted apart: the truth is the static place, which has no surface where they are.
struct MovingPoints {
  std::size_t objects = 0;   ///< known in the flight, on which points may be
  bool by_keyframe = false;  ///< a thing's place is that at the time of the point's keyframe; else all it had
  BoxMargins margins;
  PointScores apart;      ///< of the points on them, which no other score has
  PointScores with_them;  ///< of all of the map's points
};

/// Returns the key `moving_objects` of metrics.json.
nlohmann::json to_json(const MovingPoints& moving);
MovingPoints read_moving_points(base::StrictSection section);

}  // namespace tileflight::metrics
