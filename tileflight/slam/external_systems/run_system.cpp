#include "tileflight/slam/external_systems/run_system.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <thread>
#include <variant>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/exports/layout_writers.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "tileflight/slam/external_systems/handed_dataset.h"
#include "tileflight/slam/external_systems/lens_support.h"

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
  std::istringstream stream(base::read_text(file));
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

/// Throws InputError unless the system left a file of this name, of at most 4 GB.
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

/// Reads the path that a system left in `output`, by its convention, as camera-to-world poses at the frames' times.
/// Poses of an inertial unit or a lidar are moved to the camera. Throws InputError: no such file (or a huge one),
/// malformed lines, a frame that the dataset does not have, a sensor whose pose is unknown.
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

/// Counts the frames of the dataset that have an estimated pose within half a frame interval.
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

using nlohmann::json;

/// Distortion in the order of core/imaging/camera.h, with commas; empty for a plain pinhole and a panorama.
template <class Lens>
std::string distortion_text(const Lens& lens) {
  std::vector<double> numbers;
  if constexpr (requires { lens.d; }) numbers.assign(lens.d.begin(), lens.d.end());
  if constexpr (requires { lens.k; }) numbers.assign(lens.k.begin(), lens.k.end());
  if constexpr (requires { lens.xi; }) numbers.insert(numbers.begin(), lens.xi);
  if constexpr (requires { lens.w; }) numbers.push_back(lens.w);
  if constexpr (requires { lens.alpha; }) numbers.push_back(lens.alpha);
  if constexpr (requires { lens.beta; }) numbers.push_back(lens.beta);
  std::string text;
  for (const double number : numbers) text += (text.empty() ? "" : ",") + base::fixed_text(number);
  return text;
}

/// Returns the environment variables of an adapter's script (docs/systems.md).
std::map<std::string, std::string> make_environment(const Adapter& adapter, const dataset::Dataset& dataset,
                                                    const HandedDataset& handed, const fs::path& output,
                                                    const SystemRunOptions& options, int threads) {
  std::map<std::string, std::string> environment{
      {"ADAPTER", adapter.folder},
      {"DATASET", fs::absolute(handed.folder).lexically_normal()},
      {"OUT", output},
      {"SEED", std::to_string(options.seed)},
      {"THREADS", std::to_string(threads)},
      {"OMP_NUM_THREADS", std::to_string(threads)},
      {"FRAMES", std::to_string(dataset.frames.size())},
      {"FPS", base::fixed_text(exports::frame_rate_hz(dataset))},
      {"WIDTH", std::to_string(handed.calibration.camera.width())},
      {"HEIGHT", std::to_string(handed.calibration.camera.height())},
      {"LENS", lens_name(handed.calibration.camera)},
      {"TILEFLIGHT", options.program.empty() ? base::program_path() : options.program}};
  std::visit(
      [&](const auto& lens) {
        environment["DISTORTION"] = distortion_text(lens);
        environment["FX"] = base::fixed_text(lens.fx);
        environment["FY"] = base::fixed_text(lens.fy);
        environment["CX"] = base::fixed_text(lens.cx);
        environment["CY"] = base::fixed_text(lens.cy);
      },
      handed.calibration.camera.model());
  return environment;
}

/// Path and map that a system left, checked and written in this program's formats.
void take_over_results(const Adapter& adapter, const dataset::Dataset& dataset, const HandedDataset& handed,
                       const fs::path& output, const fs::path& folder, json& about) {
  const geometry::Trajectory path = read_estimated_path(adapter, output, dataset, handed);
  about["frames_tracked"] = count_tracked_frames(path, dataset);
  if (path.empty()) throw InputError(adapter.title, "tracked no frame");
  geometry::write_tum(folder / "trajectory.txt", path);
  about["lost"] = false;
  about["lost_reason"] = "";
  if (adapter.map.empty()) return;
  require_result_file(adapter, output, adapter.map);
  const geometry::PointCloud map = geometry::read_cloud(output / adapter.map);
  about["points"] = map.size();
  geometry::write_cloud(folder / "map.ply", map);
}

/// Prepares, runs and reads one system; fills `about`, the content of odometry.json.
class SystemRun {
 public:
  SystemRun(const Adapter& adapter, const dataset::Dataset& dataset, const SystemRunOptions& options)
      : adapter_(adapter), dataset_(dataset), options_(options) {}

  json run(const fs::path& folder, const Progress& progress) {
    about_ = {{"frames", dataset_.frames.size()},
              {"frames_tracked", 0},
              {"lost", true},
              {"lost_reason", ""},
              {"keyframes", nullptr},
              {"points", 0},
              {"seconds", nullptr},
              {"frames_per_second", nullptr}};
    json& system = about_["system"];
    const int threads =
        options_.threads > 0 ? options_.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
    system = {{"name", adapter_.name},
              {"title", adapter_.title},
              {"version", installed_version(adapter_)},
              {"applicable", false},
              {"completed", false},
              {"seed", options_.seed},
              {"threads", threads},
              {"limits", {{"seconds", options_.limits.seconds}, {"memory_mb", options_.limits.memory_mb}}},
              {"lens", lens_name(dataset_.calibration.camera)},
              {"layout", adapter_.layout},
              {"scale", adapter_.metric_scale ? "metric" : "unknown"}};
    std::string reason = why_not_applicable(adapter_, dataset_);
    system["applicable"] = reason.empty();
    if (reason.empty()) reason = why_not_installed(adapter_);
    if (reason.empty()) {
      try {
        reason = execute(folder, threads, progress);
      } catch (const InputError& fault) {
        system["applicable"] = false;
        reason = std::string("its input cannot be prepared: ") + fault.what();
        fs::remove_all(folder / "scratch");
      }
    }
    system["completed"] = reason.empty();
    system["reason"] = reason;
    if (!reason.empty()) about_["lost_reason"] = reason;
    return about_;
  }

 private:
  /// Returns why it failed; empty if it did not.
  std::string execute(const fs::path& folder, int threads, const Progress& progress) {
    const fs::path scratch = folder / "scratch";
    const fs::path output = fs::absolute(scratch / "out");
    fs::create_directories(output);
    const HandedDataset handed = hand_over(adapter_, dataset_, scratch, progress);
    imaging::write_kalibr(folder / "camera.yaml", handed.calibration);
    report_progress(progress, 0, 0, adapter_.title + " is running");
    const jobs::ProcessReport report =
        jobs::run_measured({.words = jobs::shell(adapter_.command),
                            .folder = adapter_.folder,
                            .log = folder / "system.log",
                            .environment = make_environment(adapter_, dataset_, handed, output, options_, threads)},
                           options_.limits);
    describe(handed, report);
    std::string reason = report.succeeded() ? "" : report.outcome();
    if (report.exit_status != 0 && !report.was_stopped()) reason += ": " + jobs::last_line(folder / "system.log");
    if (report.succeeded()) {
      try {
        take_over_results(adapter_, dataset_, handed, output, folder, about_);
      } catch (const InputError& fault) {
        reason = fault.what();
      } catch (const std::bad_alloc&) {
        reason = "its map does not fit into this machine's memory";
      }
    }
    fs::remove_all(scratch);
    return reason;
  }

  void describe(const HandedDataset& handed, const jobs::ProcessReport& report) {
    json& system = about_["system"];
    system["handed_lens"] = lens_name(handed.calibration.camera);
    system["visible_share"] = handed.visible_share;
    system["notes"] = handed.notes;
    system["exit_status"] = report.exit_status;
    system["seconds"] = report.seconds;
    system["cpu_seconds"] = report.cpu_seconds;
    system["peak_memory_mb"] = report.peak_memory_mb;
    about_["seconds"] = report.seconds;
    if (report.seconds > 0.0)
      about_["frames_per_second"] = static_cast<double>(dataset_.frames.size()) / report.seconds;
  }

  const Adapter& adapter_;
  const dataset::Dataset& dataset_;
  const SystemRunOptions& options_;
  json about_;
};

}  // namespace

json run_system(const Adapter& adapter, const fs::path& dataset_folder, const fs::path& out,
                const SystemRunOptions& options, const Progress& progress) {
  const dataset::Dataset dataset = dataset::read_dataset(dataset_folder);
  const base::OutputFolder output{
      .folder = out, .command = "odometry", .replace = options.replace, .inputs = {dataset_folder, adapter.folder}};
  json about;
  base::write_folder(output, [&](const fs::path& temporary) {
    about = SystemRun(adapter, dataset, options).run(temporary, progress);
    base::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::external_systems
