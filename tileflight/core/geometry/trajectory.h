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

/// Reads and writes TUM text: `timestamp tx ty tz qx qy qz qw` a line, '#' comments. A heading in front that names
/// these eight columns (also as qw, qx, qy, qz, and beside others) tells their order and the unit of the time. Times
/// that would be dates after the year 5000 are milliseconds, microseconds or nanoseconds (base::guess_time_unit). A row
/// of NaN in place of a pose (as where a motion capture saw nothing) is left out. Reading throws InputError (file,
/// line, cause) for malformed numbers, single NaN, a zero quaternion, or decreasing times. Of poses with equal times
/// (they occur in published ground truth with rounded clocks) the first is kept.
Trajectory read_tum(const std::filesystem::path& file);
void write_tum(const std::filesystem::path& file, const Trajectory& trajectory);

/// Returns the length of the polyline through the positions, metres.
double path_length_m(const Trajectory& trajectory);

/// Interpolates the pose at a time (position linear, rotation slerp); nullopt outside the trajectory's time span.
std::optional<SE3> interpolate(const Trajectory& trajectory, double time_s);

/// Returns index pairs (a, b) of poses nearest in time, at most `max_difference_s` apart; each index is used at most
/// once.
std::vector<std::pair<std::size_t, std::size_t>> associate(const Trajectory& a, const Trajectory& b,
                                                           double max_difference_s = 0.01);

Trajectory transformed(const Sim3& T_target_source, const Trajectory& trajectory);

/// Text formats of trajectories.
enum class TrajectoryFormat {
  kTum,    ///< `timestamp tx ty tz qx qy qz qw`, seconds
  kEuroc,  ///< `timestamp,x,y,z,qw,qx,qy,qz,…`, nanoseconds, with commas
  kKitti,  ///< the upper 3x4 of a matrix, row by row: 12 numbers a line, no times
};

/// A trajectory with the format of its file.
struct TrajectoryFile {
  Trajectory trajectory;  ///< KITTI: each pose's time is its index
  TrajectoryFormat format = TrajectoryFormat::kTum;

  bool has_times() const { return format != TrajectoryFormat::kKitti; }
};

/// Reads a trajectory in any of the formats, recognised by its first line of numbers: commas are EuRoC's, 8 numbers (or
/// a heading that names the columns) TUM's, 12 numbers KITTI's. Throws InputError (file, line, cause) as read_tum()
/// does, for a matrix that is no rotation, and for a file of another format or without poses.
TrajectoryFile read_trajectory(const std::filesystem::path& file);

/// Reads EuRoC's data.csv of poses (Burri et al., IJRR 2016): time, position and quaternion; columns after these 8 are
/// ignored. The quaternion has w first and times are whole nanoseconds, unless a header tells the order of the columns
/// and the unit ("[s]" or "(s)"), as for read_tum(). Of poses with equal times the first is kept. Throws
/// InputError (file, line, cause).
Trajectory read_euroc_poses(const std::filesystem::path& file);

}  // namespace tileflight::geometry
