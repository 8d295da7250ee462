#pragma once

#include <filesystem>

#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::geometry {

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

/// Reads a trajectory in any of the formats, recognised by its first line of numbers: commas are EuRoC's, 8 numbers
/// TUM's, 12 numbers KITTI's. Throws InputError (file, line, cause) as read_tum() does, for a matrix that is no
/// rotation, and for a file of another format or without poses.
TrajectoryFile read_trajectory(const std::filesystem::path& file);

/// EuRoC's data.csv of poses (Burri et al., IJRR 2016): time, position and quaternion; columns after these 8 are
/// ignored. The quaternion has w first, unless the header names its columns in the order x, y, z, w; times are whole
/// nanoseconds, unless the header states seconds ("[s]" or "(s)"). Of poses with equal times the first is kept. Throws
/// InputError (file, line, cause).
Trajectory read_euroc_poses(const std::filesystem::path& file);

}  // namespace tileflight::geometry
