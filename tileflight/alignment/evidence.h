#pragma once

// What is known of a map's place beside its shape: where a receiver says the camera was, how it was turned, which way
// is up. Each becomes a similarity with what is known of it (similarity_estimate.h).

#include <optional>
#include <vector>

#include "tileflight/alignment/align_trajectory.h"
#include "tileflight/alignment/similarity_estimate.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::alignment {

/// How the camera was turned at a moment, by a gimbal's or a vehicle's attitude.
struct AttitudeFix {
  double time_s = 0.0;
  Eigen::Quaterniond R_local_camera = Eigen::Quaterniond::Identity();
  double tilt_sigma_rad = 0.02;  ///< of pitch and roll
  double yaw_sigma_rad = 0.09;   ///< of the heading: a compass in a drone
};

/// A turn of the map into the local frame, and how sure it is about each local axis.
struct RotationEstimate {
  Eigen::Quaterniond R_local_map = Eigen::Quaterniond::Identity();
  geometry::Mat3 covariance = geometry::Mat3::Identity();  ///< of a small rotation vector in the local frame, rad^2
  std::size_t fixes = 0;                                   ///< that lie within the path's time
};

/// The mean over the fixes of what turns the path's camera as they say, by chordal L1 reweighting (Hartley et al., IJCV
/// 103(3), 2013, section 5), since their errors are mostly the same for a whole flight, the sigmas are not divided by
/// their number. nullopt where no fix lies within the path's time.
std::optional<RotationEstimate> rotation_by_attitude(const geometry::Trajectory& T_map_camera,
                                                     const std::vector<AttitudeFix>& fixes);

/// Which way is against gravity, map frame, and how sure.
struct UpDirection {
  geometry::Vec3 up_map = geometry::Vec3::UnitZ();
  double sigma_rad = 0.1;
  bool given = false;  ///< by who calls it: no other is looked for. An inertial unit's axes may be stated wrongly
};

/// The turn of a map about the vertical is not told by its up direction: a rotation that puts it upright, with no
/// knowledge of the heading.
RotationEstimate upright(const UpDirection& up);

/// A path's similarity from positions, with attitudes or an up direction where there are any.
struct TelemetryEstimate {
  SimilarityEstimate estimate;
  double worst_rotation_sigma_rad = 0.0;  ///< about the axis that telemetry says least of
  geometry::Vec3 worst_axis_local = geometry::Vec3::UnitZ();
};

/// Knowledge of positions (`fit`, by align_trajectory(), with the fixes that it was made of) and of the rotation where
/// there is some, together: least squares of the positions for the rotation that both leave, about the path's middle.
/// What a receiver's errors have in common over a flight (bias) is as large as the fixes' stated sigmas.
TelemetryEstimate estimate_of(const geometry::Trajectory& T_map_camera, const std::vector<PositionFix>& fixes,
                              const TrajectoryAlignment& fit, const std::optional<RotationEstimate>& rotation);

}  // namespace tileflight::alignment
