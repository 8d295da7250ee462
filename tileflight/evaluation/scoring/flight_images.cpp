#include "tileflight/evaluation/scoring/flight_images.h"

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/slam/odometry/track_result.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
using geometry::SE3;
using geometry::Vec3;
using nlohmann::json;

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
  flight.read = [&dataset](std::size_t index) -> std::optional<imaging::RgbImage> {
    try {
      return imaging::read_rgb(dataset.frames[index].image);
    } catch (const InputError&) {  // the odometry counts it as skipped
      return std::nullopt;
    }
  };
  const json about = fs::exists(map.map / "odometry.json")
                         ? json::parse(base::read_text(map.map / "odometry.json"), nullptr, false)
                         : json();
  flight.has_scale = about.is_object() && about.value("scale", "") == "metric";
  return flight;
}

}  // namespace tileflight::scoring
