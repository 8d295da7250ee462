#pragma once

#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "tileflight/geometry/transform.h"

namespace tileflight::geometry {

/// Where the camera was: T_local_camera maps camera coordinates (x right, y down, z forward) to the local frame.
struct StampedPose {
  double time_s = 0.0;
  SE3 T_local_camera;
};

/// Poses in strictly increasing time.
struct Trajectory {
  std::vector<StampedPose> poses;

  bool empty() const { return poses.empty(); }
  std::size_t size() const { return poses.size(); }
};

/// TUM text: `timestamp tx ty tz qx qy qz qw` a line, '#' comments. Reading throws InputError (file, line, cause)
/// on malformed numbers, NaN, a quaternion without length, or times that go back. Of poses with one time (published
/// ground truth has such, from rounded clocks) the first is kept.
Trajectory read_tum(const std::filesystem::path& file);
void write_tum(const std::filesystem::path& file, const Trajectory& trajectory);

/// Length of the polyline through the positions, metres.
double path_length_m(const Trajectory& trajectory);

/// The pose at a time between two poses (position linear, rotation slerp); nullopt outside the trajectory's span.
std::optional<SE3> interpolate(const Trajectory& trajectory, double time_s);

/// Index pairs (a, b) of poses with the nearest time, at most `max_difference_s` apart; each index at most once.
std::vector<std::pair<std::size_t, std::size_t>> associate(const Trajectory& a, const Trajectory& b,
                                                           double max_difference_s = 0.01);

Trajectory transformed(const Sim3& T_target_source, const Trajectory& trajectory);

}  // namespace tileflight::geometry
