#include "tileflight/capture/ingest/ingest_stage.h"

#include <string.h>  // strverscmp

#include <algorithm>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/capture/ingest/embedded_telemetry.h"
#include "tileflight/capture/ingest/photo_lens.h"
#include "tileflight/capture/ingest/telemetry_offset.h"
#include "tileflight/capture/ingest/telemetry_positions.h"
#include "tileflight/capture/recording/flight_cameras.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/ingest_rig.h"
#include "tileflight/data/flight_logs/photo_log.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/video/video.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::ingest {
namespace {

/// Adds what the log says of a zoom within the part of the video that is used. `source`: the log's name in messages.
void add_zoom_warnings(const std::vector<flight_logs::ZoomReading>& log, const std::string& source,
                       const IngestedFlightConfig& flight, std::vector<std::string>& warnings) {
  const double offset_s = flight.telemetry_offset_s.value_or(0.0);
  std::vector<flight_logs::ZoomReading> used;
  for (const flight_logs::ZoomReading& reading : log) {
    const double time_s = reading.time_s + offset_s;
    if (time_s >= flight.from_s && (!flight.to_s || time_s <= *flight.to_s)) used.push_back(reading);
  }
  base::add_distinct(flight_logs::find_zoom_warnings(used, source), warnings);
}

void add_positions(const flight_logs::Telemetry& telemetry, IngestedFlightConfig flight,
                   const std::filesystem::path& truth, dataset::IngestOptions& options,
                   std::vector<std::string>& warnings) {
  warnings.insert(warnings.end(), telemetry.warnings.begin(), telemetry.warnings.end());
  if (flight.telemetry_height == "takeoff" && !flight.takeoff_height_m && !truth.empty()) {
    flight.takeoff_height_m = estimate_takeoff_height(telemetry, flight.telemetry, truth).m;
    std::ostringstream note;
    note << "the take-off point lies " << std::fixed << std::setprecision(2) << *flight.takeoff_height_m
         << " m above the ellipsoid, according to the ground truth";
    warnings.push_back(note.str());
  }
  options.gps = to_gps_fixes(telemetry, flight, warnings);
  options.attitudes = to_camera_attitudes(telemetry);
  options.gps_time_offset_s = flight.telemetry_offset_s.value_or(0.0);
  options.description["flight_log.file"] = flight.telemetry.filename().string();
  options.description["flight_log.heights"] = height_reference_name(telemetry, flight);
}

/// Capture times of a folder's photos, unless a frame rate is given; none if not all have one. `start_utc_s`: the
/// moment that is time 0, set by the first camera of a rig.
std::map<std::string, dataset::ImageTime> photo_times(const flight_logs::PhotoLog& photos,
                                                      std::optional<double>& start_utc_s,
                                                      std::vector<std::string>& warnings) {
  base::add_distinct(photos.warnings, warnings);
  if (photos.times.size() < 2) return {};
  if (photos.times.size() < photos.photos) {
    warnings.push_back(std::to_string(photos.photos - photos.times.size()) + " of " + std::to_string(photos.photos) +
                       " photos have no capture time, so the times of all photos are ignored");
    return {};
  }
  if (!start_utc_s) start_utc_s = photos.start_utc_s;
  std::map<std::string, dataset::ImageTime> times;
  for (const auto& [name, taken] : photos.times)
    times[name] = {taken.time_s + (photos.start_utc_s - *start_utc_s), taken.exposure_ms};
  return times;
}

flight_logs::PhotoLog read_photos(const std::filesystem::path& video) {
  if (!std::filesystem::is_directory(video)) return {};
  const bool in_folder = std::filesystem::is_directory(video / "images");
  return flight_logs::read_photo_log(in_folder ? video / "images" : video);
}

/// Takes the lens from the photos' tags if no calibration is given, else compares the two.
void choose_lens(const IngestedFlightConfig& flight, const flight_logs::PhotoLog& photos,
                 dataset::IngestOptions& options, std::vector<std::string>& warnings) {
  if (!flight.camera.empty()) {
    if (photos.lenses.empty()) return;
    base::add_distinct(find_lens_warnings(photos, imaging::read_calibration(flight.camera, flight.camera_id)),
                       warnings);
    return;
  }
  if (!std::filesystem::is_directory(flight.video))
    throw InputError(flight.video.string(), std::filesystem::exists(flight.video)
                                                ? "is a video, which does not state its lens: give its calibration, "
                                                  "--camera (camera in an experiment)"
                                                : "no such video file or image folder");
  PhotoLens lens = lens_of_photos(photos, flight.video);
  base::add_distinct(lens.warnings, warnings);
  options.lens = std::move(lens.calibration);
  options.calibration = lens.photo;
  options.description["calibration.tag"] = lens.source;
}

/// Adds the photos' metadata: capture times unless a frame rate is given, and positions unless a log is given.
void add_photo_metadata(const IngestedFlightConfig& flight, const flight_logs::PhotoLog& photos,
                        const std::filesystem::path& truth, dataset::IngestOptions& options,
                        std::optional<double>& start_utc_s, std::vector<std::string>& warnings) {
  base::add_distinct(flight_logs::find_zoom_warnings(photos.zooms, "the photos' tags"), warnings);
  if (flight.fps) return;
  options.image_times = photo_times(photos, start_utc_s, warnings);
  if (options.image_times.empty() || !flight.telemetry.empty() || photos.telemetry.fixes.empty()) return;
  IngestedFlightConfig own = flight;
  own.telemetry = options.video_or_images;  // for messages
  add_positions(photos.telemetry, own, truth, options, warnings);
}

/// The rig's cameras that have a video, in the order of the rig's file.
std::vector<dataset::IngestedCamera> rig_cameras(const IngestedFlightConfig& flight) {
  const std::vector<recording::MountedCamera> mounts = recording::read_rig_cameras(flight.camera);
  const bool by_order = flight.videos.front().camera.empty();
  std::vector<std::string> names;
  for (const recording::MountedCamera& mount : mounts) names.push_back(mount.name);
  const std::string has = "has the cameras " + base::joined(names);
  if (by_order && mounts.size() > 1 && flight.videos.size() != mounts.size())
    throw InputError(flight.camera.string(), has + ", but there are " + std::to_string(flight.videos.size()) +
                                                 " videos or folders; say which is which: NAME=PATH");
  for (const CameraVideo& one : flight.videos) {
    if (!by_order && std::ranges::find(names, one.camera) == names.end())
      throw InputError(flight.camera.string(), has + ", none is called " + one.camera);
  }
  std::vector<dataset::IngestedCamera> cameras;
  for (std::size_t i = 0; i < mounts.size(); ++i) {
    const auto video = by_order ? flight.videos.begin() + static_cast<std::ptrdiff_t>(i)
                                : std::ranges::find(flight.videos, names[i], &CameraVideo::camera);
    if (video == flight.videos.end()) continue;
    const recording::MountedCamera& mount = mounts[i];
    cameras.push_back({mount.name, video->video, {}, mount.calibration, mount.T_body_camera, mount.timeshift_s});
  }
  return cameras;
}

/// Returns the files of a recording that its camera cut into parts: in the order of their numbers, which is also that
/// of the times at which they say that they were made, else with a warning.
std::vector<std::filesystem::path> ordered_parts(const IngestedFlightConfig& flight,
                                                 std::vector<std::string>& warnings) {
  std::vector<std::filesystem::path> parts;
  for (const CameraVideo& one : flight.videos) parts.push_back(one.video);
  std::ranges::stable_sort(parts, [](const std::filesystem::path& a, const std::filesystem::path& b) {
    return strverscmp(a.filename().c_str(), b.filename().c_str()) < 0;
  });
  std::vector<std::string> names;
  for (const std::filesystem::path& part : parts) names.push_back(part.filename().string());
  warnings.push_back("the " + std::to_string(parts.size()) + " videos are read as parts of one recording, because " +
                     flight.camera.filename().string() + " has one camera: " + base::joined(names));
  std::string made_before;
  for (const std::filesystem::path& part : parts) {
    if (std::filesystem::is_directory(part) || !std::filesystem::exists(part)) continue;
    const std::string made = video::probe_video(part).creation_time;
    if (!made.empty() && made < made_before)
      warnings.push_back(part.string() + ": says that it was made at " + made +
                         ", before the part that its name follows (" + made_before +
                         "); check the order, and rename the files if it is wrong");
    if (!made.empty()) made_before = made;
  }
  return parts;
}

/// The camera's path estimated by odometry from the images alone.
geometry::Trajectory estimate_camera_path(dataset::IngestOptions options, const std::filesystem::path& out,
                                          const Progress& progress) {
  const std::filesystem::path folder = base::make_temporary_path(out);
  std::filesystem::create_directories(folder);
  const base::RemovedOnExit removal(folder);
  options.gps.clear();
  options.imu.clear();
  options.groundtruth.clear();
  dataset::ingest(options, folder / "dataset", progress);
  odometry::track(folder / "dataset", folder / "odometry", false, {}, progress);
  return geometry::read_tum(folder / "odometry/trajectory.txt");
}

/// Describes an offset that was found: `time_offset` of the result's JSON.
nlohmann::json describe(const TelemetryOffset& found) {
  return {{"seconds", found.offset.offset_s},
          {"sigma_s", found.offset.sigma_s},
          {"explained", found.offset.explained_variance},
          {"source", found.source}};
}

/// `flight` of the result's JSON.
nlohmann::json describe(const LoggedFlight& flight) {
  return {{"duration_s", flight.duration_s},
          {"length_m", flight.length_m},
          {"largest_speed_m_s", flight.largest_speed_m_s},
          {"lowest_m", flight.lowest_m},
          {"highest_m", flight.highest_m}};
}

/// Converts the log's times to the video's clock by the motion recorded in both.
TelemetryOffset synchronize_telemetry(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight,
                                      const std::filesystem::path& out, dataset::IngestOptions& options,
                                      const Progress& progress) {
  TelemetryOffset found = estimate_telemetry_offset(estimate_camera_path(options, out, progress), telemetry);
  if (!found.offset.determined) {
    throw InputError(flight.telemetry.string(), "its time offset to the video cannot be determined (" +
                                                    found.offset.reason +
                                                    "); give it in seconds: --time-offset (telemetry_offset)");
  }
  options.gps_time_offset_s = found.offset.offset_s;
  const nlohmann::json about = describe(found);
  for (const auto& [key, value] : about.items())
    options.description["time_offset." + key] = value.is_string() ? value.get<std::string>() : value.dump();
  return found;
}

nlohmann::json describe(const dataset::Synchronisation& found) {
  nlohmann::json cameras;
  for (const dataset::CameraSynchronisation& camera : found.cameras)
    cameras.push_back({{"name", camera.name},
                       {"frames", camera.frames},
                       {"pairs", camera.pairs},
                       {"matched", camera.matched},
                       {"largest_skew_s", camera.largest_skew_s},
                       {"offset_s", camera.offset_s},
                       {"missing", camera.missing},
                       {"starts_late_s", camera.starts_late_s},
                       {"stops_early_s", camera.stops_early_s}});
  return {{"tolerance_s", found.tolerance_s}, {"cameras", cameras}, {"faults", found.faults}};
}

/// The arguments of ingest_dataset(), for one camera or several.
dataset::IngestOptions options_of(const IngestedFlightConfig& flight, const std::filesystem::path& truth,
                                  bool replace) {
  dataset::IngestOptions options{.video_or_images = flight.video,
                                 .calibration = flight.camera,
                                 .camera_id = flight.camera_id,
                                 .excerpt = {.from_s = flight.from_s, .to_s = flight.to_s, .every = flight.every},
                                 .imu = flight.imu,
                                 .imu_noise = flight.imu_noise,
                                 .imu_time_offset_s = flight.imu_time_offset_s,
                                 .groundtruth = flight.groundtruth,
                                 .replace = replace,
                                 .inputs = {flight.telemetry, truth},
                                 .description = {{"made_by", "tileflight ingest " + base::version()}}};
  options.image_rate_hz = flight.fps;
  return options;
}

/// Ingests the flight of a rig whose `cameras` have a video each, into `result`.
void ingest_cameras(const IngestedFlightConfig& flight, std::vector<dataset::IngestedCamera> cameras,
                    dataset::IngestOptions options, std::optional<double> start_utc_s, const std::filesystem::path& out,
                    IngestResult& result, const Progress& progress) {
  cameras.front().image_times = std::move(options.image_times);
  for (std::size_t i = 1; i < cameras.size() && !flight.fps; ++i)
    cameras[i].image_times = photo_times(read_photos(cameras[i].video_or_images), start_utc_s, result.warnings);
  dataset::RigIngestResult rig =
      dataset::ingest_rig({std::move(options), std::move(cameras), flight.sync_tolerance_s}, out, progress);
  for (const dataset::IngestResult& camera : rig.cameras) base::add_distinct(camera.notes, result.warnings);
  base::add_distinct(rig.synchronisation.faults, result.warnings);
  result.dataset = std::move(rig.cameras.front());
  result.synchronisation = std::move(rig.synchronisation);
}

/// Reads what the recording holds itself. Faults in it are warnings, since nobody asked for it.
std::optional<EmbeddedTelemetry> read_own_telemetry(const IngestedFlightConfig& flight,
                                                    const dataset::IngestOptions& options, IngestResult& result) {
  std::vector<std::filesystem::path> parts{options.video_or_images};
  parts.insert(parts.end(), options.further_parts.begin(), options.further_parts.end());
  if (!std::filesystem::exists(parts.front())) return std::nullopt;  // ingest() reports it
  try {
    std::optional<EmbeddedTelemetry> own = read_embedded_telemetry(parts);
    if (own) result.embedded = describe(*own, parts.front());
    return own;
  } catch (const InputError& fault) {
    if (flight.telemetry.empty())
      result.warnings.push_back(std::string("the video's own telemetry is not used: ") + fault.what());
    return std::nullopt;
  }
}

/// Takes the positions that the video holds, which nobody asked for: what would be an error of a given log is a warning
/// here, unless settings ask for them.
void add_own_positions(const EmbeddedTelemetry& own, const IngestedFlightConfig& flight,
                       const std::filesystem::path& truth, dataset::IngestOptions& options, IngestResult& result) {
  if (own.telemetry.fixes.empty()) {
    base::add_distinct(own.telemetry.warnings, result.warnings);
    return;
  }
  IngestedFlightConfig as_log = flight;
  as_log.telemetry = options.video_or_images;  // for messages
  try {
    add_positions(own.telemetry, as_log, truth, options, result.warnings);
    options.has_own_positions = true;
  } catch (const InputError& fault) {
    if (!flight.telemetry_height.empty()) throw;
    result.warnings.push_back(std::string("the positions in the video are left out: ") + fault.what());
  }
  add_zoom_warnings(own.telemetry.zooms, own.kind == "subtitles" ? "the subtitles" : "the video's metadata", flight,
                    result.warnings);
}

/// The exposure times of the part of the video that is used; none, with a note, if the sensor's gain changes within it
/// or is not known, since they alone do not state the brightness then.
std::vector<dataset::ImageTime> constant_gain_exposures(const std::vector<flight_logs::ExposureReading>& readings,
                                                        const IngestedFlightConfig& flight,
                                                        std::vector<std::string>& warnings) {
  constexpr double kSame = 1.02;
  std::vector<dataset::ImageTime> exposures;
  double lowest = 0.0, highest = 0.0;
  for (const flight_logs::ExposureReading& reading : readings) {
    if (reading.time_s < flight.from_s || (flight.to_s && reading.time_s > *flight.to_s)) continue;
    const double gain = reading.gain.value_or(0.0);
    lowest = exposures.empty() ? gain : std::min(lowest, gain);
    highest = std::max(highest, gain);
    exposures.push_back({reading.time_s, 1e3 * reading.exposure_s});
  }
  if (exposures.empty() || (lowest > 0.0 && highest <= kSame * lowest)) return exposures;
  warnings.push_back(
      lowest > 0.0
          ? base::formatted("the exposure times in the video are left out, since the sensor's gain changes by a "
                            "factor of %.2f: they alone do not state the brightness",
                            highest / lowest)
          : "the exposure times in the video are left out, since the sensor's gain is not recorded with them: "
            "they alone do not state the brightness");
  return {};
}

/// Adds the readings of the camera's own inertial unit, unless others are given, and its exposures.
void add_camera_readings(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight,
                         bool is_one_camera, dataset::IngestOptions& options, std::vector<std::string>& warnings) {
  if (!is_one_camera) {
    if (!telemetry.inertial.empty() && flight.imu.empty())
      warnings.emplace_back(
          "the readings of the inertial unit in the first camera are left out: a rig's are in the axes of its body; "
          "give them with --imu");
    return;
  }
  if (flight.imu.empty()) options.camera_imu = telemetry.inertial;
  options.exposures = constant_gain_exposures(telemetry.exposures, flight, warnings);
}

}  // namespace

flight_logs::Telemetry read_flight_log(const std::filesystem::path& file) {
  if (!is_video(file)) return flight_logs::read_telemetry(file);
  std::optional<EmbeddedTelemetry> own = read_embedded_telemetry({file});
  if (!own)
    throw InputError(file.string(),
                     "is a video without a track of subtitles or of GoPro's or DJI's metadata, so it is no flight log: "
                     "give the .srt, CSV or GPX that was recorded beside it");
  if (own->telemetry.fixes.empty())
    throw InputError(
        file.string(),
        "holds no positions in its " + own->kind +
            (own->telemetry.warnings.empty() ? "" : " (" + base::joined(own->telemetry.warnings, "; ") + ")"));
  return std::move(own->telemetry);
}

IngestResult ingest_dataset(const IngestedFlightConfig& flight, const std::filesystem::path& truth,
                            const std::filesystem::path& out, bool replace, const Progress& progress) {
  dataset::IngestOptions options = options_of(flight, truth, replace);
  std::vector<dataset::IngestedCamera> cameras;
  IngestResult result;
  if (!flight.videos.empty() && flight.camera.empty())
    throw InputError(flight.videos.front().video.string(),
                     "is one of several videos, whose cameras are not known: give their calibration, --camera");
  if (!flight.videos.empty()) cameras = rig_cameras(flight);
  if (cameras.size() == 1 && flight.videos.size() > 1) {
    std::vector<std::filesystem::path> parts = ordered_parts(flight, result.warnings);
    options.video_or_images = parts.front();
    options.further_parts.assign(parts.begin() + 1, parts.end());
    check_chapters(parts);
    cameras.clear();
  } else if (!cameras.empty()) {
    options.video_or_images = cameras.front().video_or_images;
    options.lens = cameras.front().calibration;
  }
  const std::optional<EmbeddedTelemetry> own = read_own_telemetry(flight, options, result);
  const flight_logs::PhotoLog photos = read_photos(options.video_or_images);
  if (flight.videos.empty()) choose_lens(flight, photos, options, result.warnings);
  flight_logs::Telemetry telemetry;
  if (!flight.telemetry.empty()) {
    telemetry = read_flight_log(flight.telemetry);
    if (!is_video(flight.telemetry)) {
      for (const flight_logs::RangeReading& range : flight_logs::read_ranges(flight.telemetry))
        options.ranges.push_back({range.time_s, range.range_m});
    }
    add_positions(telemetry, flight, truth, options, result.warnings);
    add_zoom_warnings(telemetry.zooms, is_video(flight.telemetry) ? "the video's metadata" : "the subtitles", flight,
                      result.warnings);
    if (own && own->kind != "subtitles") base::add_distinct(own->telemetry.warnings, result.warnings);
  } else if (own) {
    add_own_positions(*own, flight, truth, options, result);
    if (!cameras.empty()) options.gps_time_offset_s += cameras.front().timeshift_s;  // the body's clock
    telemetry = own->telemetry;
  }
  if (own) {
    add_camera_readings(own->telemetry, flight, cameras.empty(), options, result.warnings);
  } else if (!telemetry.inertial.empty() && flight.imu.empty()) {
    result.warnings.push_back("the readings of the inertial unit in " + flight.telemetry.filename().string() +
                              " are not used, since it is another video");
  }
  if (!truth.empty()) options.description.merge(place::describe_frame(place::read_extract_json(truth).origin));
  std::optional<double> start_utc_s;
  add_photo_metadata(flight, photos, truth, options, start_utc_s, result.warnings);
  if (!options.gps.empty()) {
    result.flight = describe_flight(options.gps);
    base::add_distinct(find_implausible(*result.flight, options.gps), result.warnings);
  }
  if (flight.estimates_telemetry_offset) {
    result.time_offset = synchronize_telemetry(telemetry, flight, out, options, progress);
    if (!cameras.empty()) options.gps_time_offset_s += cameras.front().timeshift_s;  // the body's clock
  }
  if (!cameras.empty()) {
    ingest_cameras(flight, std::move(cameras), std::move(options), start_utc_s, out, result, progress);
  } else {
    result.dataset = dataset::ingest(options, out, progress);
    result.warnings.insert(result.warnings.end(), result.dataset.notes.begin(), result.dataset.notes.end());
  }
  return result;
}

nlohmann::json to_json(const IngestResult& result) {
  const dataset::IngestResult& dataset = result.dataset;
  nlohmann::json json{{"frames", dataset.frames},
                      {"first_time_s", dataset.times_s.front()},
                      {"last_time_s", dataset.times_s.back()},
                      {"resolution", {dataset.width, dataset.height}},
                      {"positions", dataset.gps_fixes},
                      {"imu_readings", dataset.imu_readings},
                      {"embedded", result.embedded.empty() ? nlohmann::json() : nlohmann::json(result.embedded)},
                      {"flight", result.flight ? describe(*result.flight) : nlohmann::json()},
                      {"time_offset", result.time_offset ? describe(*result.time_offset) : nlohmann::json()},
                      {"true_poses", dataset.groundtruth_poses},
                      {"warnings", result.warnings}};
  if (result.synchronisation) json["synchronisation"] = describe(*result.synchronisation);
  return json;
}

}  // namespace tileflight::ingest
