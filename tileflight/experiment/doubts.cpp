#include "tileflight/experiment/doubts.h"

#include <algorithm>

#include "tileflight/dataset/dataset.h"
#include "tileflight/evaluation/doubts_json.h"
#include "tileflight/experiment/flight_faults.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr const char* kOdometry = "odometry";
constexpr const char* kTruth = "truth";

std::string text_of(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

double number_of(const json& object, const char* key, double fallback) {
  const auto found = object.find(key);
  return found != object.end() && found->is_number() ? found->get<double>() : fallback;
}

/// Frames of the dataset without a pose, as a share.
void doubt_gaps(double frames, double tracked, Doubts& doubts) {
  constexpr double kFew = 0.95;
  if (!(frames > 0.0) || tracked >= kFew * frames) return;
  doubts.push_back({std::to_string(static_cast<long>(tracked)) + " of " + std::to_string(static_cast<long>(frames)) +
                        " frames have a pose",
                    kOdometry, "certain", "look at the frames without one; choose another stretch of the flight"});
}

}  // namespace

Doubts doubts_in(const fs::path& json_file) {
  if (!fs::exists(json_file)) return {};
  const json object = json::parse(geometry::read_text(json_file), nullptr, false);
  if (!object.is_object() || !object.contains("doubts")) return {};
  return evaluation::doubts_from_json(object["doubts"], json_file.string());
}

Doubts doubts_of_odometry(const MapInputs& map) {
  Doubts doubts;
  const fs::path file = map.map / "odometry.json";
  if (fs::is_directory(map.map) && fs::exists(file)) {
    const json about = json::parse(geometry::read_text(file), nullptr, false);
    append(doubts, doubts_in(file));
    if (about.is_object() && about.contains("doubts")) return doubts;  // our own odometry's, complete
    if (about.is_object() && about.value("lost", false)) {
      const std::string why = text_of(about, "lost_reason");
      doubts.push_back({"the flight was not tracked to its end" + (why.empty() ? "" : ": " + why), kOdometry, "certain",
                        "use the part that was tracked, or a flight that stays trackable"});
    }
    if (about.is_object()) doubt_gaps(number_of(about, "frames", 0.0), number_of(about, "frames_tracked", 0.0), doubts);
    return doubts;
  }
  if (map.dataset.empty() || map.trajectory.empty()) return doubts;
  doubt_gaps(static_cast<double>(dataset::read_dataset(map.dataset).frames.size()),
             static_cast<double>(geometry::read_tum(map.trajectory).size()), doubts);
  return doubts;
}

Doubts doubts_of_truth(const json& about) {
  Doubts doubts;
  if (!about.value("complete", true)) {
    doubts.push_back({std::to_string(static_cast<long>(number_of(about, "tiles_failed", 0.0))) + " of " +
                          std::to_string(static_cast<long>(number_of(about, "tiles_wanted", 0.0))) +
                          " tiles of the ground truth are missing",
                      kTruth, "certain", "fetch the missing tiles and extract again"});
  }
  constexpr double kCoarse_m = 0.5;
  const double error_m = number_of(about, "geometric_error_max", 0.0);
  if (error_m > kCoarse_m) {
    std::string metres = std::to_string(error_m);
    metres.resize(metres.find('.') + 3);
    doubts.push_back({"the ground truth's tiles may err by " + metres + " m, by their own geometric error", kTruth,
                      "possible", "ask for finer tiles (--error), or read distances below that as agreement"});
  }
  return doubts;
}

Doubts doubts_of_dataset(const fs::path& folder) {
  Doubts doubts;
  if (folder.empty()) return doubts;
  for (const sensors::FlightFault& fault : recorded_faults(dataset::read_dataset(folder).about)) {
    const bool only_near = fault.key == "camera_near_surface" || fault.key == "no_surface_in_view";
    doubts.push_back({fault.what + " (frames " + frame_runs(fault.frames) + ")", "dataset",
                      only_near ? "possible" : "likely", "look at those pictures, and change the flight"});
  }
  return doubts;
}

void append(Doubts& doubts, const Doubts& more) {
  for (const Doubt& doubt : more) {
    const auto same = [&](const Doubt& d) { return d.what == doubt.what && d.where == doubt.where; };
    if (std::ranges::none_of(doubts, same)) doubts.push_back(doubt);
  }
}

Doubts of_flight(Doubts doubts, const std::string& flight) {
  for (Doubt& doubt : doubts) doubt.where = flight + "/" + doubt.where;
  return doubts;
}

}  // namespace tileflight::experiment
