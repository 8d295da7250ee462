#include <nlohmann/json.hpp>

#include <iomanip>
#include <sstream>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/temporary_path.h"
#include "tileflight/dataset/ingest.h"
#include "tileflight/flight_logs/photo_log.h"
#include "tileflight/flight_logs/telemetry_file.h"
#include "tileflight/place/extract.h"
#include "tileflight/place/version.h"
#include "tileflight/survey/render_stage.h"
#include "tileflight/survey/takeoff_height.h"
#include "tileflight/survey/telemetry_offset.h"
#include "tileflight/survey/telemetry_positions.h"
#include "tileflight/survey/track.h"

namespace tileflight::survey {
namespace {

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
}

/// Adds the photos' metadata: capture times unless a frame rate is given, and positions unless a log is given.
void add_photo_metadata(const IngestedFlightConfig& flight, const std::filesystem::path& truth,
                        dataset::IngestOptions& options, std::vector<std::string>& warnings) {
  if (!std::filesystem::is_directory(flight.video)) return;
  const bool in_folder = std::filesystem::is_directory(flight.video / "images");
  const flight_logs::PhotoLog photos = flight_logs::read_photo_log(in_folder ? flight.video / "images" : flight.video);
  if (photos.times.size() < 2 || flight.fps) return;
  if (photos.times.size() < photos.photos) {
    warnings.push_back(std::to_string(photos.photos - photos.times.size()) + " of " + std::to_string(photos.photos) +
                       " photos have no capture time, so the times of all photos are ignored");
    return;
  }
  warnings.insert(warnings.end(), photos.warnings.begin(), photos.warnings.end());
  for (const auto& [name, taken] : photos.times) options.image_times[name] = {taken.time_s, taken.exposure_ms};
  if (!flight.telemetry.empty() || photos.telemetry.fixes.empty()) return;
  IngestedFlightConfig own = flight;
  own.telemetry = flight.video;  // for messages
  add_positions(photos.telemetry, own, truth, options, warnings);
}

/// A temporary folder beside a file, removed by the destructor.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const std::filesystem::path& file) : path_(base::make_temporary_path(file)) {
    std::filesystem::create_directories(path_);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The camera's path estimated by odometry from the images alone.
geometry::Trajectory estimate_camera_path(dataset::IngestOptions options, const std::filesystem::path& out,
                                          const Progress& progress) {
  const TemporaryFolder folder(out);
  options.gps.clear();
  options.groundtruth.clear();
  dataset::ingest(options, folder.path() / "dataset", progress);
  track(folder.path() / "dataset", folder.path() / "odometry", false, {}, {}, progress);
  return geometry::read_tum(folder.path() / "odometry/trajectory.txt");
}

/// Converts the log's times to the video's clock by the motion recorded in both.
nlohmann::json synchronize_telemetry(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight,
                                     const std::filesystem::path& out, dataset::IngestOptions& options,
                                     const Progress& progress) {
  const TelemetryOffset found = estimate_telemetry_offset(estimate_camera_path(options, out, progress), telemetry);
  if (!found.offset.determined) {
    throw InputError(flight.telemetry.string(), "its time offset to the video cannot be determined (" +
                                                    found.offset.reason +
                                                    "); give it in seconds: --time-offset (telemetry_offset)");
  }
  options.gps_time_offset_s = found.offset.offset_s;
  const nlohmann::json about{{"seconds", found.offset.offset_s},
                             {"sigma_s", found.offset.sigma_s},
                             {"explained", found.offset.explained_variance},
                             {"source", found.source}};
  for (const auto& [key, value] : about.items())
    options.description["time_offset." + key] = value.is_string() ? value.get<std::string>() : value.dump();
  return about;
}

}  // namespace

nlohmann::json ingest_dataset(const IngestedFlightConfig& flight, const std::filesystem::path& truth,
                              const std::filesystem::path& out, bool replace, const Progress& progress) {
  dataset::IngestOptions options{.video_or_images = flight.video,
                                 .calibration = flight.camera,
                                 .camera_id = flight.camera_id,
                                 .excerpt = {.from_s = flight.from_s, .to_s = flight.to_s, .every = flight.every},
                                 .groundtruth = flight.groundtruth,
                                 .replace = replace,
                                 .inputs = {flight.telemetry, truth},
                                 .description = {{"made_by", "tileflight ingest " + place::version()}}};
  if (flight.fps) options.image_rate_hz = *flight.fps;
  std::vector<std::string> warnings;
  flight_logs::Telemetry telemetry;
  if (!flight.telemetry.empty()) {
    telemetry = flight_logs::read_telemetry(flight.telemetry);
    for (const flight_logs::RangeReading& range : flight_logs::read_ranges(flight.telemetry))
      options.ranges.push_back({range.time_s, range.range_m});
    add_positions(telemetry, flight, truth, options, warnings);
  }
  if (!truth.empty())
    options.description.merge(place::describe_frame(place::origin_from_json(place::read_extract_json(truth))));
  add_photo_metadata(flight, truth, options, warnings);
  nlohmann::json time_offset;  // null: not requested
  if (flight.estimates_telemetry_offset) time_offset = synchronize_telemetry(telemetry, flight, out, options, progress);
  const dataset::IngestResult result = dataset::ingest(options, out, progress);
  warnings.insert(warnings.end(), result.notes.begin(), result.notes.end());
  return {{"frames", result.frames},
          {"first_time_s", result.first_time_s},
          {"last_time_s", result.last_time_s},
          {"resolution", {result.width, result.height}},
          {"positions", result.gps_fixes},
          {"time_offset", time_offset},
          {"true_poses", result.groundtruth_poses},
          {"warnings", warnings}};
}

}  // namespace tileflight::survey
