#pragma once

// Evidence from telemetry about a map's placement: receiver positions, camera attitude, and up direction. Each is
// converted to a SimilarityEstimate (similarity_estimate.h). The up direction may come from an accelerometer on the
// vehicle.

#include <optional>
#include <vector>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/registration/similarity_estimate.h"

namespace tileflight::registration {

/// Orientation of the camera at a time, from a gimbal's or a vehicle's attitude.
struct AttitudeFix {
  double time_s = 0.0;
  Eigen::Quaterniond R_local_camera = Eigen::Quaterniond::Identity();
  double tilt_sigma_rad = 0.02;  ///< of pitch and roll
  double yaw_sigma_rad = 0.09;   ///< of the heading; typical of a drone's compass
};

/// Rotation from the map to the local frame, with its covariance.
struct RotationEstimate {
  Eigen::Quaterniond R_local_map = Eigen::Quaterniond::Identity();
  geometry::Mat3 covariance = geometry::Mat3::Identity();  ///< of a small rotation vector in the local frame, rad^2
  std::size_t fixes = 0;                                   ///< number of fixes within the path's time range
};

/// Estimates the rotation from map to local frame as the mean over the fixes of the rotation from the path's
/// orientation to the stated one, by chordal L1 reweighting (Hartley et al., IJCV 103(3), 2013, section 5). Errors are
/// mostly common to a whole flight, so the number of fixes does not reduce the sigmas. Returns nullopt if no fix lies
/// within the path's time range.
std::optional<RotationEstimate> rotation_from_attitudes(const geometry::Trajectory& T_map_camera,
                                                        const std::vector<AttitudeFix>& fixes);

/// Direction against gravity, map frame, with its uncertainty.
struct UpDirection {
  geometry::Vec3 up_map = geometry::Vec3::UnitZ();
  double sigma_rad = 0.1;
  bool given = false;  ///< given by the caller: no other direction is tried. A direction from an inertial unit is not,
                       ///< since its axes may be stated wrongly
};

/// Returns the rotation that makes a map upright. Its heading is unknown, since the up direction does not determine the
/// rotation about the vertical.
RotationEstimate upright_rotation(const UpDirection& up);

/// Similarity of a path from positions and, if available, attitudes or an up direction.
struct TelemetryEstimate {
  SimilarityEstimate estimate;
  double worst_rotation_sigma_rad = 0.0;  ///< about the axis that telemetry determines least
  geometry::Vec3 worst_axis_local = geometry::Vec3::UnitZ();
};

/// Combines positions (`fit` from align_trajectory(), with its `fixes`) and, if known, the rotation: least squares of
/// the positions for the combined rotation, about the path's centre. The receiver's bias over a flight is taken to be
/// as large as the fixes' stated sigmas.
TelemetryEstimate estimate_from_telemetry(const geometry::Trajectory& T_map_camera,
                                          const std::vector<alignment::PositionFix>& fixes,
                                          const alignment::TrajectoryAlignment& fit,
                                          const std::optional<RotationEstimate>& rotation);

/// Returns how far the path, placed by `T_local_map`, lies from the fixes: the median along each axis, metres; zero if
/// no fix is of the path's time. The fixes' clock is taken as stated or shifted by `time_offset_s`, whichever is
/// nearer. The similarity that fits the fixes best is not used: on a short arc their noise may look like an offset of
/// the clocks, which slides it along the path.
geometry::Vec3 distance_to_fixes(const geometry::Trajectory& T_map_camera,
                                 const std::vector<alignment::PositionFix>& fixes, const geometry::Sim3& T_local_map,
                                 double time_offset_s);

/// An accelerometer reading rotated into the camera's axes (x right, y down, z forward); at rest 9.81 m/s^2 upwards.
struct SpecificForce {
  double time_s = 0.0;  ///< on the path's clock
  geometry::Vec3 force_m_s2 = geometry::Vec3::Zero();
};

/// Estimates the up direction of a map from an accelerometer. Over an interval the mean specific force equals the mean
/// acceleration, (v_1 - v_0) / (t_1 - t_0) with the path's velocities v times its scale, plus gravity directed upwards.
/// Gravity and the unknown scale are estimated by least squares over the intervals. Returns nullopt if path and
/// readings overlap too little in time, or if the estimated gravity is not within a twentieth of 9.81 m/s^2 (wrong
/// units or clock; wrong axes, if the camera rotated). Wrong axes are not detected while the camera does not rotate.
std::optional<UpDirection> estimate_up_from_accelerometer(const geometry::Trajectory& T_map_camera,
                                                          const std::vector<SpecificForce>& readings);

}  // namespace tileflight::registration
