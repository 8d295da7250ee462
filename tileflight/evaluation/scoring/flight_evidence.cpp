#include "tileflight/evaluation/scoring/flight_evidence.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/core/alignment/align_trajectory.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/evaluation/localization/ground_planes.h"
#include "tileflight/evaluation/registration/telemetry_estimate.h"
#include "tileflight/slam/odometry/track_result.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using nlohmann::json;

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

/// Reads an image; nullopt if it cannot be decoded, which the odometry counts as skipped. Throws InputError if there is
/// no such file.
std::optional<imaging::RgbImage> read_if_decodable(const fs::path& image) {
  try {
    return imaging::read_rgb(image);
  } catch (const InputError&) {
    if (!fs::exists(image)) throw;
    return std::nullopt;
  }
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
  evidence.pictures.picture = [files](std::size_t k) { return read_if_decodable(files[k]); };
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

localization::FlightImages flight_images(const dataset::Dataset& dataset, const MapInputs& map) {
  localization::FlightImages flight;
  flight.images.resize(dataset.frames.size());
  geometry::Trajectory times;
  for (const dataset::Frame& frame : dataset.frames) times.poses.push_back({frame.time_s, SE3()});
  const geometry::Trajectory path = geometry::read_tum(map.trajectory);
  constexpr double kSameTime_s = 1e-3;
  std::vector<std::optional<std::size_t>> pose_of(dataset.frames.size());
  for (const auto& [pose, frame] : geometry::associate(path, times, kSameTime_s)) {
    flight.images[frame].T_map_camera = path.poses[pose].T_local_camera;
    pose_of[frame] = pose;
  }
  // Other systems state no sigmas: a hundredth of the step and a twentieth of a degree are assumed.
  constexpr double kShareOfStep = 0.01, kRotation_rad = 0.05 * geometry::kRadiansPerDegree;
  for (std::size_t i = 1; i < flight.images.size(); ++i) {
    if (!pose_of[i] || *pose_of[i] == 0) continue;
    const Vec3 before = path.poses[*pose_of[i] - 1].T_local_camera.translation;
    flight.images[i].sigma_position = kShareOfStep * (flight.images[i].T_map_camera->translation - before).norm();
    flight.images[i].sigma_rotation_rad = kRotation_rad;
  }
  if (fs::exists(map.map / "quality.csv")) {
    const double per_axis = 1.0 / std::sqrt(3.0);
    std::size_t i = 0;
    for (const odometry::FrameQuality& quality : odometry::read_quality_csv(map.map / "quality.csv")) {
      while (i < dataset.frames.size() && dataset.frames[i].time_s < quality.time_s - kSameTime_s) ++i;
      if (i == dataset.frames.size() || std::abs(dataset.frames[i].time_s - quality.time_s) > kSameTime_s) continue;
      if (!(quality.sigma_position > 0.0)) continue;
      flight.images[i].sigma_position = per_axis * quality.sigma_position;
      flight.images[i].sigma_rotation_rad = per_axis * quality.sigma_rotation_rad;
    }
  }
  flight.read = [&dataset](std::size_t index) { return read_if_decodable(dataset.frames[index].image); };
  const json about = fs::exists(map.map / "odometry.json")
                         ? json::parse(base::read_text(map.map / "odometry.json"), nullptr, false)
                         : json();
  flight.has_scale = about.is_object() && about.value("scale", "") == "metric";
  return flight;
}

}  // namespace tileflight::scoring
