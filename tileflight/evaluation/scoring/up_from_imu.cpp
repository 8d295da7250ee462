#include "tileflight/evaluation/scoring/up_from_imu.h"

#include "tileflight/data/dataset/imu_files.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"

namespace tileflight::scoring {

std::optional<registration::UpDirection> up_from_imu(const dataset::Dataset& dataset,
                                                     const geometry::Trajectory& path) {
  if (path.empty() || dataset.imu.empty()) return std::nullopt;
  const Eigen::Quaterniond R_cam_imu = dataset.calibration.T_cam_imu.rotation;
  std::vector<registration::SpecificForce> readings;
  for (const geometry::ImuSample& reading : dataset::read_imu_csv(dataset.imu))
    readings.push_back({reading.time_s, R_cam_imu * reading.specific_force_m_s2});
  return registration::estimate_up_from_accelerometer(path, readings);
}

}  // namespace tileflight::scoring
