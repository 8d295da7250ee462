#include <iomanip>
#include <sstream>

#include "tileflight/dataset/ingest.h"
#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/positions.h"
#include "tileflight/experiment/takeoff_anchor.h"
#include "tileflight/experiment/version.h"
#include "tileflight/flight/photo_log.h"
#include "tileflight/flight/telemetry_file.h"

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

}  // namespace

nlohmann::json ingest_dataset(const IngestFlight& flight, const std::filesystem::path& truth,
                              const std::filesystem::path& out, bool replace, const Progress& progress) {
  dataset::IngestOptions options{.video_or_images = flight.video,
                                 .calibration = flight.camera,
                                 .excerpt = {.from_s = flight.from_s, .to_s = flight.to_s, .every = flight.every},
                                 .groundtruth = flight.groundtruth,
                                 .replace = replace,
                                 .description = {{"made_by", "tileflight ingest " + version()}}};
  if (flight.fps) options.image_rate_hz = *flight.fps;
  std::vector<std::string> warnings;
  if (!flight.telemetry.empty())
    add_positions(flight::read_telemetry(flight.telemetry), flight, truth, options, warnings);
  add_photos(flight, truth, options, warnings);
  const dataset::IngestResult result = dataset::ingest(options, out, progress);
  warnings.insert(warnings.end(), result.notes.begin(), result.notes.end());
  return {{"frames", result.frames},
          {"first_time_s", result.first_time_s},
          {"last_time_s", result.last_time_s},
          {"resolution", {result.width, result.height}},
          {"positions", result.gps_fixes},
          {"true_poses", result.groundtruth_poses},
          {"warnings", warnings}};
}

}  // namespace tileflight::experiment
