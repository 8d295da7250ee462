#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/core/geometry/imu_sample.h"

namespace tileflight::dataset {

/// IMU noise parameters for estimators, under Kalibr's names.
struct ImuCalibration {
  double update_rate_hz = 200.0;
  double accelerometer_noise_density = 0.0;  ///< m/s^2/sqrt(Hz)
  double accelerometer_random_walk = 0.0;    ///< m/s^3/sqrt(Hz)
  double gyroscope_noise_density = 0.0;      ///< rad/s/sqrt(Hz)
  double gyroscope_random_walk = 0.0;        ///< rad/s^2/sqrt(Hz)
};

/// imu.csv with the columns of EuRoC's imu0/data.csv: time in whole nanoseconds, angular rate, specific force. A first
/// header without '#' is accepted, as in VSLAM-LAB's imu_0.csv ("ts (ns),wx (rad s^-1), ..."); times are in
/// seconds if it says so ("timestamp [s]"). Reading throws InputError (file, line, cause): malformed or non-finite
/// numbers, times that do not increase.
std::vector<geometry::ImuSample> read_imu_csv(const std::filesystem::path& file);
void write_imu_csv(const std::filesystem::path& file, const std::vector<geometry::ImuSample>& readings);

/// imu.yaml in Kalibr's format. Reading throws InputError for missing or negative numbers.
ImuCalibration read_imu_yaml(const std::filesystem::path& file);
/// The same of any file that states it: Kalibr's imu.yaml, EuRoC's imu0/sensor.yaml, or VSLAM-LAB's calibration.yaml in
/// its forms. Throws InputError for missing or negative numbers.
ImuCalibration read_imu_noise(const std::filesystem::path& file);
void write_imu_yaml(const std::filesystem::path& file, const ImuCalibration& calibration);

}  // namespace tileflight::dataset
