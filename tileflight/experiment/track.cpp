#include "tileflight/experiment/track.h"

#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>

#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/cloud_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/trajectory.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/imaging/photometric.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// The frames of the range. Played backwards, time runs from the last frame's: odometry needs it to increase.
std::vector<dataset::Frame> chosen_frames(const dataset::Dataset& data, const FrameRange& range) {
  const std::size_t end = std::min(range.to.value_or(data.frames.size()), data.frames.size());
  if (range.from >= end) {
    throw InputError(data.folder.string(), "no frames from " + std::to_string(range.from) + " to " +
                                               std::to_string(end) + " (the dataset has " +
                                               std::to_string(data.frames.size()) + ")");
  }
  std::vector<dataset::Frame> frames;
  for (std::size_t i = range.from; i < end; i += range.every) frames.push_back(data.frames[i]);
  if (range.reverse) std::reverse(frames.begin(), frames.end());
  return frames;
}

/// Reads the chosen images one by one. Time is negated while they are played backwards; restore_times() undoes it.
odometry::FrameSource source_of(const std::vector<dataset::Frame>& frames, bool reverse) {
  return [&frames, reverse, at = std::size_t{0}]() mutable -> std::optional<odometry::InputFrame> {
    if (at == frames.size()) return std::nullopt;
    const dataset::Frame& frame = frames[at];
    odometry::InputFrame input{.index = static_cast<std::int64_t>(at),
                               .time_s = reverse ? -frame.time_s : frame.time_s,
                               .exposure_ms = frame.exposure_ms,
                               .image = imaging::read_rgb(frame.image)};
    ++at;
    return input;
  };
}

void restore_times(geometry::Trajectory& trajectory) {
  for (geometry::StampedPose& pose : trajectory.poses) pose.time_s = -pose.time_s;
  std::reverse(trajectory.poses.begin(), trajectory.poses.end());
}

std::optional<imaging::PhotometricCalibration> photometric_of(const dataset::Dataset& data) {
  if (data.pcalib.empty() && data.vignette.empty()) return std::nullopt;
  return imaging::read_photometric(data.pcalib, data.vignette);
}

json describe(const odometry::OdometryResult& result) {
  return {{"frames", result.frames},
          {"frames_tracked", result.frames_tracked},
          {"lost", result.lost},
          {"lost_reason", result.lost_reason},
          {"keyframes", result.keyframes.size()},
          {"points", result.map.size()},
          {"seconds", result.seconds},
          {"frames_per_second", result.seconds > 0 ? static_cast<double>(result.frames) / result.seconds : 0.0}};
}

std::string quoted(const fs::path& path) {
  std::string result = "'";
  for (const char c : fs::absolute(path).string()) result += c == '\'' ? "'\\''" : std::string(1, c);
  return result + "'";
}

std::string filled_in(std::string command, const std::string& name, const std::string& value) {
  for (std::size_t at = command.find(name); at != std::string::npos; at = command.find(name, at + value.size())) {
    command.replace(at, name.size(), value);
  }
  return command;
}

void run_command(const std::string& command, const fs::path& log) {
  const int status = std::system(("( " + command + " ) > " + quoted(log) + " 2>&1 < /dev/null").c_str());
  if (status == 0) return;
  const std::string how =
      WIFEXITED(status) ? "exit status " + std::to_string(WEXITSTATUS(status)) : "killed by a signal";
  std::string last_line;
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last_line = line;
  }
  throw InputError("odometry.command", how + ": " + last_line);
}

json describe_outside_result(const fs::path& out, std::size_t frames) {
  const geometry::Trajectory trajectory = geometry::read_tum(out / "trajectory.txt");
  const geometry::PointCloud map = geometry::read_cloud(out / "map.ply");
  return {
      {"frames", frames},           {"frames_tracked", trajectory.size()},
      {"lost", trajectory.empty()}, {"lost_reason", trajectory.empty() ? "the outside program tracked no frame" : ""},
      {"keyframes", nullptr},       {"points", map.size()},
      {"seconds", nullptr},         {"frames_per_second", nullptr}};
}

}  // namespace

nlohmann::json track(const fs::path& dataset_folder, const fs::path& out, bool replace,
                     const odometry::OdometryOptions& options, const FrameRange& range, const Progress& progress) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder);
  const std::optional<imaging::PhotometricCalibration> photometric = photometric_of(data);
  const std::vector<dataset::Frame> frames = chosen_frames(data, range);
  json about;
  geometry::write_folder(out, replace, [&](const fs::path& temporary) {
    const Progress counted = [&](std::int64_t done, std::int64_t, std::string_view what) {
      report_progress(progress, done, static_cast<std::int64_t>(frames.size()), what);
    };
    odometry::OdometryResult result = odometry::run_odometry(data.calibration, photometric ? &*photometric : nullptr,
                                                             source_of(frames, range.reverse), options, counted);
    if (range.reverse) {
      restore_times(result.trajectory);
      restore_times(result.keyframes);
    }
    geometry::write_tum(temporary / "trajectory.txt", result.trajectory);
    geometry::write_tum(temporary / "keyframes.txt", result.keyframes);
    geometry::write_cloud(temporary / "map.ply", result.map);
    about = describe(result);
    geometry::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

nlohmann::json track_with_command(const fs::path& dataset_folder, const fs::path& out, bool replace,
                                  const std::string& command) {
  const dataset::Dataset data = dataset::read_dataset(dataset_folder);
  json about;
  geometry::write_folder(out, replace, [&](const fs::path& temporary) {
    run_command(filled_in(filled_in(command, "{dataset}", quoted(dataset_folder)), "{out}", quoted(temporary)),
                temporary / "command.log");
    for (const char* name : {"trajectory.txt", "map.ply"}) {
      if (!fs::exists(temporary / name))
        throw InputError("odometry.command", std::string("left no ") + name + " in {out}");
    }
    about = describe_outside_result(temporary, data.frames.size());
    if (!fs::exists(temporary / "odometry.json"))
      geometry::write_file(temporary / "odometry.json", about.dump(2) + "\n");
  });
  return about;
}

}  // namespace tileflight::experiment
