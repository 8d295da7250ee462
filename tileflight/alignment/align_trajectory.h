#pragma once

#include <string>
#include <vector>

#include "tileflight/alignment/umeyama.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::alignment {

/// One position of a receiver, already in the local frame.
struct PositionFix {
  double time_s = 0.0;  ///< on the receiver's clock
  geometry::Vec3 position;
  double horizontal_sigma_m = 0.0;  ///< 0: not known
  double vertical_sigma_m = 0.0;
};

struct AlignTrajectoryOptions {
  bool estimate_time_offset = true;
  double max_time_offset_s = 2.0;
  ScaleMode scale = ScaleMode::kEstimated;
  RobustOptions robust{};  ///< the inlier distance is widened to three times the fixes' sigma
};

struct TrajectoryAlignment {
  geometry::Sim3 T_local_map;
  double time_offset_s =
      0.0;  ///< a fix of time t shows where the camera was at t + offset; a receiver that lags has it negative
  double time_offset_sigma_s = 0.0;  ///< roughly; 0 where it was not estimated
  std::size_t pairs = 0;             ///< fixes within the trajectory's time, repeated positions counted once
  std::size_t inliers = 0;
  double rmse_m = 0.0;          ///< over the inliers
  double roll_sigma_rad = 0.0;  ///< about the line that fits the path best: large for a straight flight
  std::string note;             ///< empty, or one line: what is doubtful
};

/// Similarity from the map's frame to the local frame, from camera positions against a receiver's: robust Umeyama over
/// positions interpolated to the fixes' times. The constant offset between the two clocks (and the receiver's lag) is
/// searched on a grid of +-max_time_offset_s for the least robust residual and refined by a parabola; where the path
/// does not tell it (straight and even flight), it is left at zero. Throws InputError: empty or non-finite input, fewer
/// than three fixes within the trajectory's time.
TrajectoryAlignment align_trajectory(const geometry::Trajectory& T_map_camera, const std::vector<PositionFix>& fixes,
                                     const AlignTrajectoryOptions& options = {});

}  // namespace tileflight::alignment
