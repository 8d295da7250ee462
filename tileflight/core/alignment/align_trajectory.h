#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/alignment/umeyama.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::alignment {

/// Estimates the unit direction against gravity in the frame of a camera path. A camera on an upright vehicle yaws and
/// pitches but hardly rolls, so its x axis stays level: up is the direction most nearly perpendicular to all x axes, on
/// the side of the image tops. nullopt if the path does not determine it: the camera rotated by only a few degrees, or
/// rolled as much as it yawed.
std::optional<geometry::Vec3> estimate_up_from_trajectory(const geometry::Trajectory& trajectory);

/// One position of a receiver, already in the local frame.
struct PositionFix {
  double time_s = 0.0;  ///< on the receiver's clock
  geometry::Vec3 position;
  double horizontal_sigma_m = 0.0;  ///< 0: unknown
  double vertical_sigma_m = 0.0;
};

struct AlignTrajectoryOptions {
  bool estimate_time_offset = true;
  double max_time_offset_s = 2.0;
  ScaleMode scale = ScaleMode::kEstimated;
  RobustUmeyamaOptions robust{};  ///< the inlier distance is raised to three times the fixes' sigma
};

struct TrajectoryAlignment {
  geometry::Sim3 T_local_map;
  double time_offset_s =
      0.0;  ///< a fix at time t is the camera's position at t + offset; negative for a receiver that lags
  double time_offset_sigma_s = 0.0;  ///< approximate; 0 if not estimated
  std::size_t pairs = 0;             ///< fixes within the trajectory's time range, repeated positions counted once
  std::size_t inliers = 0;
  double rmse_m = 0.0;          ///< over the inliers
  double roll_sigma_rad = 0.0;  ///< about the best-fitting line of the path; large for a straight flight
  std::string note;             ///< warning, one line; empty: none
};

/// Estimates the similarity from the map frame to the local frame, from camera positions and a receiver's positions:
/// robust Umeyama over positions interpolated to the fixes' times. The constant clock offset (including the receiver's
/// lag) is searched on a grid of +-max_time_offset_s for the smallest robust residual and refined by a parabola; it
/// stays zero if the path does not determine it (straight flight at constant speed). Throws InputError for empty or
/// non-finite input, and for fewer than three fixes within the trajectory's time range.
TrajectoryAlignment align_trajectory(const geometry::Trajectory& T_map_camera, const std::vector<PositionFix>& fixes,
                                     const AlignTrajectoryOptions& options = {});

}  // namespace tileflight::alignment
