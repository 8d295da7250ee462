#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::app {

namespace {

/// Sets the offset of the log's times. `text` is the option's value; empty: not given.
void set_time_offset(const std::string& text, ingest::IngestedFlightConfig& flight) {
  if (text.empty()) return;
  flight.estimates_telemetry_offset = text == "auto";
  if (flight.estimates_telemetry_offset) return;
  const auto seconds = base::parse_number<double>(text);
  if (!seconds || !std::isfinite(*seconds))
    throw CLI::ValidationError("--time-offset", "must be 'auto' or a number of seconds, got '" + text + "'");
  flight.telemetry_offset_s = *seconds;
}

/// Sets the videos. `paths` has one PATH for a single camera, or PATH or NAME=PATH for each camera of a rig.
void set_videos(const std::vector<std::string>& paths, ingest::IngestedFlightConfig& flight) {
  for (const std::string& text : paths) {
    const std::size_t sign = std::filesystem::exists(text) ? std::string::npos : text.find('=');
    if (sign == std::string::npos) {
      flight.videos.push_back({"", text});
    } else {
      flight.videos.push_back({text.substr(0, sign), text.substr(sign + 1)});
    }
  }
  const auto has_name = [](const ingest::CameraVideo& one) { return !one.camera.empty(); };
  const auto named = static_cast<std::size_t>(std::ranges::count_if(flight.videos, has_name));
  if (named != 0 && named != paths.size())
    throw CLI::ValidationError("VIDEO", "give all cameras a name (NAME=PATH), or none");
  for (const ingest::CameraVideo& one : flight.videos) {
    if (has_name(one) && std::ranges::count(flight.videos, one.camera, &ingest::CameraVideo::camera) > 1)
      throw CLI::ValidationError("VIDEO", "camera " + one.camera + " is given twice");
  }
  if (paths.size() > 1 || named > 0) return;
  flight.video = flight.videos.front().video;
  flight.videos.clear();
}

std::string synchronisation_text(const nlohmann::json& found) {
  std::ostringstream text;
  for (const nlohmann::json& camera : found["cameras"])
    text << camera["name"].get<std::string>() << ": " << camera["frames"] << " frames, " << camera["matched"] << " of "
         << camera["pairs"] << " of one instant with the first camera's, largest skew "
         << 1e3 * camera["largest_skew_s"].get<double>() << " ms, " << camera["missing"] << " missing\n";
  return text.str();
}

struct IngestOptions {
  ingest::IngestedFlightConfig flight;
  std::vector<std::string> videos;
  std::string camera, telemetry, imu, imu_noise, truth, groundtruth, out, time_offset;
};

void add_log_options(CLI::App& command, IngestOptions& options) {
  command.add_option("--telemetry", options.telemetry,
                     "flight log (DJI .srt, a video with such subtitles or GoPro's or DJI's metadata, GPX, KML, CSV, "
                     "NMEA, PX4 .ulg, ArduPilot .bin, MAVLink .tlog) or folder of photos; default: what VIDEO holds");
  command.add_option("--telemetry-height", options.flight.telemetry_height, "height reference (datum) of the log")
      ->check(CLI::IsMember({"ellipsoid", "sea-level", "takeoff"}));
  command.add_option("--takeoff-height", options.flight.takeoff_height_m,
                     "height of the take-off point above the ellipsoid, metres");
  command.add_option("--time-offset", options.time_offset,
                     "seconds to add to the log's times to get the video's; auto: estimated from the motion in both");
  command.add_option("--truth", options.truth,
                     "folder written by `extract`; the height of the take-off point is taken from its surface");
}

void add_imu_options(CLI::App& command, IngestOptions& options) {
  command.add_option("--imu", options.imu,
                     "readings of an inertial unit: a table whose header names time, gyroscope and accelerometer, as "
                     "EuRoC's imu0/data.csv; Gyroflow's .gcsv or a Betaflight blackbox log; default: what VIDEO holds");
  command.add_option(
      "--imu-noise", options.imu_noise,
      "its noise: Kalibr's imu.yaml, EuRoC's imu0/sensor.yaml, ORB-SLAM3's settings or basalt's calibration");
  command.add_option("--imu-time-offset", options.flight.imu_time_offset_s,
                     "seconds to add to its times to get the video's; odometry finds what is left of it");
}

/// Sets the values of the flight that are not read directly into it.
void complete_flight(IngestOptions& options) {
  set_videos(options.videos, options.flight);
  // Photos may state their lens.
  if (options.camera.empty() && !(options.videos.size() == 1 && std::filesystem::is_directory(options.videos.front())))
    throw CLI::RequiredError("--camera");
  if (options.camera.empty() && !options.flight.camera_id.empty())
    throw CLI::ValidationError("--camera-id", "selects a camera of a calibration; give it with --camera");
  if (!options.flight.videos.empty() && !options.flight.camera_id.empty())
    throw CLI::ValidationError("--camera-id", "is of a single camera; name a rig's by NAME=PATH");
  options.flight.camera = options.camera;
  options.flight.telemetry = options.telemetry;
  options.flight.imu = options.imu;
  options.flight.imu_noise = options.imu_noise;
  options.flight.groundtruth = options.groundtruth;
  set_time_offset(options.time_offset, options.flight);
  if (options.flight.estimates_telemetry_offset && options.telemetry.empty())
    throw CLI::ValidationError("--time-offset", "applies to a flight log; give one with --telemetry");
}

Output ingest(const IngestOptions& options, bool force, const Progress& progress) {
  const nlohmann::json r =
      ingest::to_json(ingest::ingest_dataset(options.flight, options.truth, options.out, force, progress));
  std::ostringstream text;
  text << options.out << ": " << r["frames"] << " frames, " << r["positions"] << " positions";
  if (r["imu_readings"] > 0) text << ", " << r["imu_readings"] << " readings of the inertial unit";
  text << "\n";
  if (!r["embedded"].is_null()) text << "found " << r["embedded"].get<std::string>() << "\n";
  if (const nlohmann::json& flight = r["flight"]; !flight.is_null()) {
    text << base::formatted("flight log: %.1f s, %.0f m, up to %.1f m/s, %.1f to %.1f m above the ellipsoid\n",
                            flight["duration_s"].get<double>(), flight["length_m"].get<double>(),
                            flight["largest_speed_m_s"].get<double>(), flight["lowest_m"].get<double>(),
                            flight["highest_m"].get<double>());
  }
  if (r.contains("synchronisation")) text << synchronisation_text(r["synchronisation"]);
  for (const auto& warning : r["warnings"]) text << "note: " << warning.get<std::string>() << "\n";
  return {r, text.str()};
}

}  // namespace

void add_ingest(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<IngestOptions>();
  CLI::App* command = app.add_subcommand("ingest", "turn a filmed flight into a dataset");
  command->footer(
      "Example:\n  tileflight ingest flight.mp4 --camera camera.yaml --telemetry flight.srt --telemetry-height "
      "ellipsoid --every 4 --out dataset\n"
      "  tileflight ingest left=cam0.mp4 right=cam1.mp4 --camera camchain.yaml --out rig");
  command
      ->add_option(
          "VIDEO", options->videos,
          "video file or folder of images; of a rig, one of each camera, in the order of the calibration or as "
          "NAME=PATH")
      ->required();
  command->add_option(
      "--camera", options->camera,
      "calibration: Kalibr camchain, OpenCV YAML or XML, COLMAP cameras, DSO camera.txt, ORB-SLAM3, VSLAM-LAB, VINS, "
      "basalt, OpenSfM, OpenDroneMap, nerfstudio, Agisoft or a lens profile of Gyroflow (docs/formats.md); of a rig, "
      "its "
      "camchain or a file with `cameras`; of photos, by default what their tags state");
  command->add_option("--camera-id", options->flight.camera_id,
                      "camera to use if the calibration holds several: cam1 (Kalibr), 2 (COLMAP's CAMERA_ID)");
  add_log_options(*command, *options);
  add_imu_options(*command, *options);
  command->add_option("--groundtruth", options->groundtruth, "true poses (TUM), times on the video's clock");
  command->add_option("--from", options->flight.from_s, "start of the excerpt, seconds");
  command->add_option("--to", options->flight.to_s, "end of the excerpt, seconds");
  command->add_option("--every", options->flight.every, "use every n-th frame")->check(CLI::PositiveNumber);
  command
      ->add_option("--fps", options->flight.fps, "frame rate of an image folder without times.txt, frames per second")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--sync-tolerance", options->flight.sync_tolerance_s,
                   "images of a rig's cameras that differ by no more are of one instant, seconds")
      ->check(CLI::Range(1e-9, 10.0))
      ->capture_default_str();
  command->add_option("--out", options->out, "dataset folder to write")->required();
  add_common_options(*command, common);
  command->callback([options, &selection] {
    complete_flight(*options);
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return ingest(*options, shared.force, progress);
    };
  });
}

}  // namespace tileflight::app
