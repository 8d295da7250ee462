#include "tileflight/experiment/up_direction.h"

#include "tileflight/alignment/inertial_up.h"
#include "tileflight/dataset/imu_files.h"

namespace tileflight::experiment {

std::optional<alignment::UpDirection> up_by_inertial_unit(const dataset::Dataset& dataset,
                                                          const geometry::Trajectory& path) {
  const std::filesystem::path file = dataset.folder / "imu.csv";
  if (path.empty() || !std::filesystem::is_regular_file(file)) return std::nullopt;
  const Eigen::Quaterniond R_cam_imu = dataset.calibration.T_cam_imu.rotation;
  std::vector<alignment::SpecificForce> readings;
  for (const dataset::ImuReading& reading : dataset::read_imu_csv(file))
    readings.push_back({reading.time_s, R_cam_imu * reading.specific_force_m_s2});
  return alignment::up_of_specific_force(path, readings);
}

}  // namespace tileflight::experiment
