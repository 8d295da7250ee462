#include "tileflight/evaluation/scoring/flight_evidence.h"

#include <algorithm>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/evaluation/localization/ground_planes.h"
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

namespace {

/// Adds a direction unless it nearly equals one of `ups`, which would be searched twice.
void add_distinct_direction(const geometry::Vec3& up, std::vector<geometry::Vec3>& ups) {
  constexpr double kAlike = 0.9982;  // cosine of 0.06 rad: a tilt that the fit corrects (ground_agreement_test.cpp)
  if (std::ranges::none_of(ups, [&](const geometry::Vec3& other) { return other.dot(up) > kAlike; })) ups.push_back(up);
}

}  // namespace

localization::FlightEvidence make_flight_evidence(const dataset::Dataset& dataset, const geometry::Trajectory& path,
                                                  const geometry::PointCloud& map,
                                                  const std::optional<registration::UpDirection>& up) {
  localization::FlightEvidence evidence;
  geometry::Trajectory times;
  for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, geometry::SE3()});
  constexpr double kSameTime_s = 1e-3;
  std::vector<std::filesystem::path> files;
  for (const auto& [pose, frame] : geometry::associate(path, times, kSameTime_s)) {
    evidence.pictures.T_map_camera.push_back(path.poses[pose].T_local_camera);
    files.push_back(dataset.frames[frame].image);
  }
  evidence.pictures.camera = dataset.calibration.camera;
  evidence.pictures.picture = [files](std::size_t k) { return imaging::read_rgb(files[k]); };
  evidence.points = map.positions;
  if (up) evidence.up_candidates = {up->up_map.normalized()};
  if (up && up->given) return evidence;
  if (const auto carried = alignment::estimate_up_from_trajectory(path)) {
    add_distinct_direction(*carried, evidence.up_candidates);
  } else {
    for (const auto& plane : localization::find_ground_planes(map.positions, evidence.pictures.T_map_camera))
      add_distinct_direction(plane.up, evidence.up_candidates);
  }
  return evidence;
}

}  // namespace tileflight::scoring
