#include "tileflight/slam/external_systems/system_output.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <sstream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::external_systems {
namespace fs = std::filesystem;
namespace {

using geometry::SE3;
using geometry::StampedPose;
using geometry::Trajectory;

double frame_time_s(const fs::path& file, const dataset::Dataset& dataset, double index) {
  const auto frame = static_cast<std::size_t>(std::max(0.0, index));
  if (index != std::floor(index) || index < 0.0 || frame >= dataset.frames.size()) {
    std::ostringstream what;
    what << "has a pose for frame " << index << ", but the dataset has " << dataset.frames.size() << " frames";
    throw InputError(file.string(), what.str());
  }
  return dataset.frames[frame].time_s;
}

/// images.txt of COLMAP's text model: `ID QW QX QY QZ TX TY TZ CAMERA NAME`, world to camera, every second line.
/// Frames are told by their file's name.
Trajectory read_colmap_images(const fs::path& file, const dataset::Dataset& dataset) {
  std::map<std::string, double> times_s;
  for (const dataset::Frame& frame : dataset.frames) times_s[frame.image.stem().string()] = frame.time_s;
  std::ifstream stream(file);
  if (!stream) throw InputError(file.string(), "cannot be read");
  std::map<double, SE3> poses;
  std::string line;
  for (int number = 1; std::getline(stream, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream fields(line);
    long id = 0, camera = 0;
    SE3 T;
    Eigen::Quaterniond& q = T.rotation;
    std::string name;
    fields >> id >> q.w() >> q.x() >> q.y() >> q.z() >> T.translation.x() >> T.translation.y() >> T.translation.z() >>
        camera >> name;
    const auto time = times_s.find(fs::path(name).stem().string());
    if (!fields || !(q.norm() > 0.5) || !T.translation.allFinite())
      throw InputError(file.string() + ":" + std::to_string(number), "is no line of an image");
    if (time == times_s.end())
      throw InputError(file.string() + ":" + std::to_string(number), "names '" + name + "', which is no frame");
    q.normalize();
    poses[time->second] = T;
    std::getline(stream, line);  // its points
    ++number;
  }
  Trajectory trajectory;
  for (const auto& [time_s, T] : poses) trajectory.poses.push_back({time_s, T});
  return trajectory;
}

/// Maps the camera's coordinates to those of the sensor whose poses are given.
SE3 sensor_from_camera(const Adapter& adapter, const HandedDataset& handed) {
  if (adapter.path.of == "imu") return handed.calibration.T_cam_imu.inverse();
  if (adapter.path.of != "lidar") return {};
  if (!handed.T_cam_lidar)
    throw InputError(adapter.folder.string(),
                     "says that its poses are the lidar's, whose place on the camera is unknown");
  return handed.T_cam_lidar->inverse();
}

}  // namespace

void require_result_file(const Adapter& adapter, const fs::path& output, const std::string& name) {
  constexpr std::uintmax_t kLargestBytes = std::uintmax_t{4} << 30;
  std::error_code fault;
  const fs::file_status status = fs::status(output / name, fault);
  if (!fs::exists(status)) throw InputError(adapter.title, "left no " + name);
  if (!fs::is_regular_file(status)) throw InputError(adapter.title, "left " + name + ", which is no file");
  const std::uintmax_t bytes = fs::file_size(output / name, fault);
  if (fault) throw InputError(adapter.title, "left " + name + ", which cannot be read: " + fault.message());
  if (bytes > kLargestBytes)
    throw InputError(adapter.title, "left " + name + " of " + std::to_string(bytes >> 30) + " GB; at most " +
                                        std::to_string(kLargestBytes >> 30) + " GB are read");
}

Trajectory read_estimated_path(const Adapter& adapter, const fs::path& output, const dataset::Dataset& dataset,
                               const HandedDataset& handed) {
  const PathConvention& convention = adapter.path;
  const fs::path file = output / convention.file;
  require_result_file(adapter, output, convention.file);
  Trajectory path;
  bool times_are_indices = convention.times == "frame-indices";
  if (convention.is_colmap_model) {
    path = read_colmap_images(file, dataset);
  } else if (fs::file_size(file) > 0) {
    geometry::TrajectoryFile read = geometry::read_trajectory(file);
    times_are_indices |= !read.has_times();
    path = std::move(read.trajectory);
  }
  const SE3 T_sensor_camera = sensor_from_camera(adapter, handed);
  for (StampedPose& pose : path.poses) {
    if (convention.times == "nanoseconds") pose.time_s *= 1e-9;
    if (times_are_indices) pose.time_s = frame_time_s(file, dataset, pose.time_s);
    SE3 T = pose.T_local_camera;
    if (!convention.camera_to_world) T = T.inverse();
    pose.T_local_camera = T * T_sensor_camera;
  }
  return path;
}

std::size_t count_tracked_frames(const Trajectory& path, const dataset::Dataset& dataset) {
  double interval_s = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < dataset.frames.size(); ++i)
    interval_s = std::min(interval_s, dataset.frames[i].time_s - dataset.frames[i - 1].time_s);
  std::size_t tracked = 0, k = 0;
  for (const dataset::Frame& frame : dataset.frames) {
    while (k < path.size() && path.poses[k].time_s < frame.time_s - 0.5 * interval_s) ++k;
    if (k < path.size() && path.poses[k].time_s <= frame.time_s + 0.5 * interval_s) ++tracked;
  }
  return tracked;
}

}  // namespace tileflight::external_systems
