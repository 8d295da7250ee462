#pragma once

#include <string>

#include "tileflight/live/simulator/airsim_types.h"

namespace tileflight::simulator {

struct World;

/// Readings of the vehicles' sensors. An empty sensor name means the vehicle's first sensor of that kind.
class Sensors {
 public:
  explicit Sensors(World& world) : world_(world) {}

  /// Scans a full rotation from the present pose, without noise.
  LidarData get_lidar_data(const std::string& lidar, const std::string& vehicle);
  /// Returns LidarData::segmentation of a scan of its own.
  std::vector<int> get_lidar_segmentation(const std::string& lidar, const std::string& vehicle);
  ImuData get_imu_data(const std::string& imu, const std::string& vehicle);
  BarometerData get_barometer_data(const std::string& barometer, const std::string& vehicle);
  MagnetometerData get_magnetometer_data(const std::string& magnetometer, const std::string& vehicle);
  GpsData get_gps_data(const std::string& gps, const std::string& vehicle);
  DistanceSensorData get_distance_sensor_data(const std::string& distance_sensor, const std::string& vehicle);
  /// Scans as get_lidar_data(), with the segmentation colour and intensity of each point.
  GPULidarData get_gpu_lidar_data(const std::string& lidar, const std::string& vehicle);
  EchoData get_echo_data(const std::string& echo, const std::string& vehicle);
  /// Scans as get_lidar_data(), with intensity, channel and time of each point.
  LidarScanData lidar_scan(const std::string& lidar, const std::string& vehicle);

 private:
  World& world_;
};

}  // namespace tileflight::simulator
