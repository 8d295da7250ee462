#include <iomanip>
#include <sstream>

#include "tileflight/dataset/ingest.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/positions.h"
#include "tileflight/experiment/takeoff_anchor.h"
#include "tileflight/experiment/telemetry_offset.h"
#include "tileflight/experiment/track.h"
#include "tileflight/experiment/version.h"
#include "tileflight/flight/photo_log.h"
#include "tileflight/flight/telemetry_file.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/temporary_path.h"

namespace tileflight::experiment {
namespace {

void add_positions(const flight::Telemetry& telemetry, IngestFlight flight, const std::filesystem::path& truth,
                   dataset::IngestOptions& options, std::vector<std::string>& warnings) {
  warnings.insert(warnings.end(), telemetry.warnings.begin(), telemetry.warnings.end());
  if (flight.telemetry_height == "takeoff" && !flight.takeoff_height_m && !truth.empty()) {
    flight.takeoff_height_m = takeoff_height(telemetry, flight.telemetry, truth).m;
    std::ostringstream note;
    note << "the take-off place lies " << std::fixed << std::setprecision(2) << *flight.takeoff_height_m
         << " m above the ellipsoid, by the ground truth";
    warnings.push_back(note.str());
  }
  options.gps = gps_fixes(telemetry, flight, warnings);
  options.attitudes = camera_attitudes(telemetry);
  options.gps_time_offset_s = flight.telemetry_offset_s.value_or(0.0);
}

/// What photos say of themselves: when they were taken unless a rate is given, and where unless a log says so.
void add_photos(const IngestFlight& flight, const std::filesystem::path& truth, dataset::IngestOptions& options,
                std::vector<std::string>& warnings) {
  if (!std::filesystem::is_directory(flight.video)) return;
  const bool in_folder = std::filesystem::is_directory(flight.video / "images");
  const flight::PhotoLog photos = flight::read_photo_log(in_folder ? flight.video / "images" : flight.video);
  if (photos.times.size() < 2 || flight.fps) return;
  if (photos.times.size() < photos.photos) {
    warnings.push_back(std::to_string(photos.photos - photos.times.size()) + " of " + std::to_string(photos.photos) +
                       " photos do not say when they were taken, so that none is asked");
    return;
  }
  warnings.insert(warnings.end(), photos.warnings.begin(), photos.warnings.end());
  for (const auto& [name, taken] : photos.times) options.image_times[name] = {taken.time_s, taken.exposure_ms};
  if (!flight.telemetry.empty() || photos.telemetry.fixes.empty()) return;
  IngestFlight own = flight;
  own.telemetry = flight.video;  // whom messages name
  add_positions(photos.telemetry, own, truth, options, warnings);
}

/// A folder beside a file, for as long as this lives.
class FolderBeside {
 public:
  explicit FolderBeside(const std::filesystem::path& file) : path_(geometry::temporary_beside(file)) {
    std::filesystem::create_directories(path_);
  }
  FolderBeside(const FolderBeside&) = delete;
  FolderBeside& operator=(const FolderBeside&) = delete;
  ~FolderBeside() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The camera's path as odometry finds it on the pictures alone.
geometry::Trajectory tracked_path(dataset::IngestOptions options, const std::filesystem::path& out,
                                  const Progress& progress) {
  const FolderBeside folder(out);
  options.gps.clear();
  options.groundtruth.clear();
  dataset::ingest(options, folder.path() / "dataset", progress);
  track(folder.path() / "dataset", folder.path() / "odometry", false, {}, {}, progress);
  return geometry::read_tum(folder.path() / "odometry/trajectory.txt");
}

/// Puts the log's positions on the video's clock, which the motion that both have seen tells.
nlohmann::json find_offset(const flight::Telemetry& telemetry, const IngestFlight& flight,
                           const std::filesystem::path& out, dataset::IngestOptions& options,
                           const Progress& progress) {
  const TelemetryOffset found = telemetry_offset(tracked_path(options, out, progress), telemetry);
  if (!found.offset.determined) {
    throw InputError(flight.telemetry.string(), "its time offset to the video is not determined (" +
                                                    found.offset.reason +
                                                    "); give it in seconds: --time-offset (telemetry_offset)");
  }
  options.gps_time_offset_s = found.offset.offset_s;
  const nlohmann::json about{{"seconds", found.offset.offset_s},
                             {"sigma_s", found.offset.sigma_s},
                             {"explained", found.offset.explained},
                             {"source", found.source}};
  for (const auto& [key, value] : about.items())
    options.description["time_offset." + key] = value.is_string() ? value.get<std::string>() : value.dump();
  return about;
}

}  // namespace

nlohmann::json ingest_dataset(const IngestFlight& flight, const std::filesystem::path& truth,
                              const std::filesystem::path& out, bool replace, const Progress& progress) {
  dataset::IngestOptions options{.video_or_images = flight.video,
                                 .calibration = flight.camera,
                                 .camera_id = flight.camera_id,
                                 .excerpt = {.from_s = flight.from_s, .to_s = flight.to_s, .every = flight.every},
                                 .groundtruth = flight.groundtruth,
                                 .replace = replace,
                                 .inputs = {flight.telemetry, truth},
                                 .description = {{"made_by", "tileflight ingest " + version()}}};
  if (flight.fps) options.image_rate_hz = *flight.fps;
  std::vector<std::string> warnings;
  flight::Telemetry telemetry;
  if (!flight.telemetry.empty()) {
    telemetry = flight::read_telemetry(flight.telemetry);
    for (const flight::RangeReading& range : flight::read_ranges(flight.telemetry))
      options.ranges.push_back({range.time_s, range.range_m});
    add_positions(telemetry, flight, truth, options, warnings);
  }
  if (!truth.empty()) options.description.merge(described_frame(origin_of(read_extract_json(truth))));
  add_photos(flight, truth, options, warnings);
  nlohmann::json time_offset;  // null: not asked for
  if (flight.finds_telemetry_offset) time_offset = find_offset(telemetry, flight, out, options, progress);
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

}  // namespace tileflight::experiment
