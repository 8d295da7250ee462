#pragma once

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::geometry {

/// Camera pose at a time: T_local_camera maps camera coordinates (x right, y down, z forward) to the local frame.
struct StampedPose {
  double time_s = 0.0;
  SE3 T_local_camera;
};

/// Poses in strictly increasing order of time.
struct Trajectory {
  std::vector<StampedPose> poses;

  bool empty() const { return poses.empty(); }
  std::size_t size() const { return poses.size(); }
};

/// TUM text: `timestamp tx ty tz qx qy qz qw` a line, '#' comments. Reading throws InputError (file, line, cause) for
/// malformed numbers, NaN, a zero quaternion, or decreasing times. Of poses with equal times (they occur in published
/// ground truth with rounded clocks) the first is kept.
Trajectory read_tum(const std::filesystem::path& file);
void write_tum(const std::filesystem::path& file, const Trajectory& trajectory);

/// Length of the polyline through the positions, metres.
double path_length_m(const Trajectory& trajectory);

/// Pose at a time between two poses (position linear, rotation slerp); nullopt outside the trajectory's time span.
std::optional<SE3> interpolate(const Trajectory& trajectory, double time_s);

/// Index pairs (a, b) of poses nearest in time, at most `max_difference_s` apart; each index is used at most once.
std::vector<std::pair<std::size_t, std::size_t>> associate(const Trajectory& a, const Trajectory& b,
                                                           double max_difference_s = 0.01);

Trajectory transformed(const Sim3& T_target_source, const Trajectory& trajectory);

}  // namespace tileflight::geometry
