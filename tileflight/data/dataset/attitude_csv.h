#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <vector>

namespace tileflight::dataset {

/// A line of attitude.csv: the camera's attitude at a time, as logged by a gimbal or vehicle.
struct CameraAttitude {
  double time_s = 0.0;
  /// Rotation from camera axes (x right, y down, z forward) to east, north, up at the place; unit length.
  Eigen::Quaterniond R_enu_camera = Eigen::Quaterniond::Identity();
  double tilt_sigma_deg = 0.0;  ///< of pitch and roll
  double yaw_sigma_deg = 0.0;   ///< of the heading
};

/// Columns `t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg` under that header, times strictly increasing. Reading throws
/// InputError (file, line, cause): other columns, numbers that are not finite, a quaternion of zero length, sigmas that
/// are not positive, times that decrease.
std::vector<CameraAttitude> read_attitude_csv(const std::filesystem::path& file);
void write_attitude_csv(const std::filesystem::path& file, const std::vector<CameraAttitude>& attitudes);

}  // namespace tileflight::dataset
