#pragma once

#include <Eigen/Geometry>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/geometry/imu_sample.h"

namespace tileflight::dataset {

/// A CSV file of numbers with a header, for the other sensors' readings. Infinities are written as inf and -inf.
struct NumberTable {
  std::vector<std::string> columns;       ///< names with units: "pressure [Pa]"
  std::vector<std::vector<double>> rows;  ///< one number per column
};

/// Read and write a table; numbers round-trip exactly. Reading throws InputError (file, line, cause): no header, a row
/// of another length, a cell that is not a number.
NumberTable read_number_table(const std::filesystem::path& file);
void write_number_table(const std::filesystem::path& file, const NumberTable& table);

/// Attitude of the camera at a time, as a gimbal or vehicle logged it; a line of attitude.csv.
struct CameraAttitude {
  double time_s = 0.0;
  /// Rotation from camera axes (x right, y down, z forward) to east, north, up at the place; unit length.
  Eigen::Quaterniond R_enu_camera = Eigen::Quaterniond::Identity();
  double tilt_sigma_deg = 0.0;  ///< of pitch and roll
  double yaw_sigma_deg = 0.0;   ///< of the heading
};

/// Read and write attitude.csv, with the columns `t,qx,qy,qz,qw,tilt_sigma_deg,yaw_sigma_deg` under that header and
/// strictly increasing times. Reading throws InputError (file, line, cause): other columns, numbers that are not
/// finite, a quaternion that does not have unit length, sigmas that are not positive, times that do not increase.
std::vector<CameraAttitude> read_attitude_csv(const std::filesystem::path& file);
void write_attitude_csv(const std::filesystem::path& file, const std::vector<CameraAttitude>& attitudes);

/// IMU noise parameters for estimators, under Kalibr's names.
struct ImuCalibration {
  double update_rate_hz = 200.0;
  double accelerometer_noise_density = 0.0;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 0.0;    ///< m/s^3/sqrt(Hz)
  double gyroscope_noise_density = 0.0;      ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 0.0;        ///< rad/s^2/sqrt(Hz)
};

/// Reads the readings of an inertial unit from a table. A header in the first line, with or without '#', decides which
/// column is which ("ts (ns),ax [g],…,gyro_z [deg/s]"), their units, and whether times are in seconds ("timestamp
/// [s]"); further columns are named in `notes`, as units that are assumed. Without a header the columns are those of
/// EuRoC's imu0/data.csv: time in whole nanoseconds, angular rate, specific force. Throws InputError (file, line,
/// cause): a header that lacks a reading or names an unknown unit, malformed or non-finite numbers, times that do not
/// increase, columns without names whose first three have the length of gravity.
std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file, std::vector<std::string>& notes);
/// Reads without the notes.
std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file);
/// Writes imu.csv with the columns of EuRoC's imu0/data.csv.
void write_imu_csv(const std::filesystem::path& file, const std::vector<geometry::ImuSample>& readings);

/// Reads the noise parameters from any file that states them: Kalibr's imu.yaml, flat or under `imu0` as Kalibr and
/// OpenVINS write it, EuRoC's imu0/sensor.yaml, VSLAM-LAB's calibration.yaml in its forms, ORB-SLAM3's settings, or
/// basalt's calibration. Throws InputError for missing or negative numbers, and for VINS's, which are no densities.
ImuCalibration read_imu_noise(const std::filesystem::path& file);
/// Writes imu.yaml in Kalibr's format.
void write_imu_yaml(const std::filesystem::path& file, const ImuCalibration& calibration);

}  // namespace tileflight::dataset
