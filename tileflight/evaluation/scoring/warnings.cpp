#include "tileflight/evaluation/scoring/warnings.h"

#include <algorithm>
#include <filesystem>
#include <iomanip>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/capture/recording/flight_faults.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::scoring {

void answer_path_warnings(const MapInputs& map, const registration::PictureAgreement& pictures, Warnings& warnings) {
  constexpr double kPathShare = 0.005;
  constexpr std::size_t kFewest = 10;
  const bool is_measured = pictures.tried >= kFewest && 10 * pictures.located >= 9 * pictures.tried;
  if (!is_measured || !(pictures.path_error_m <= kPathShare * pictures.path_length_m)) return;
  const std::filesystem::path file = map.map / "odometry.json";
  if (std::error_code none; !std::filesystem::exists(file, none)) return;
  const nlohmann::json about = nlohmann::json::parse(base::read_text(file), nullptr, false);
  const nlohmann::json path =
      about.is_object() ? about.value("path_warnings", nlohmann::json::array()) : nlohmann::json::array();
  for (Warning& warning : warnings) {
    if (warning.severity != Severity::kWarning ||
        std::ranges::find(path, nlohmann::json(warning.message)) == path.end())
      continue;
    warning.severity = Severity::kNote;
    warning.remedy = base::formatted(
        "nothing, if the place is as it was: %zu of %zu images, located in it, differ by %.2g %% of the path's length",
        pictures.located, pictures.tried, 100.0 * pictures.path_error_m / pictures.path_length_m);
  }
}

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

/// Adds a warning about the share of the dataset's frames without a pose.
void check_tracking_gaps(double frames, double tracked, Warnings& warnings) {
  constexpr double kFew = 0.95;
  if (!(frames > 0.0) || tracked >= kFew * frames) return;
  warnings.push_back({std::to_string(static_cast<long>(tracked)) + " of " + std::to_string(static_cast<long>(frames)) +
                          " frames have a pose",
                      kOdometry, Severity::kError,
                      "look up the frames without a pose; choose another part of the flight"});
}

/// Returns the times at which a flight has no images; none for an unknown flight.
std::vector<metrics::TimeGap> gaps_of_images(const fs::path& dataset, double duration_s) {
  if (dataset.empty()) return {};
  geometry::Trajectory images;
  try {
    for (const dataset::Frame& frame : dataset::read_dataset(dataset).frames)
      images.poses.push_back({frame.time_s, {}});
  } catch (const InputError&) {  // positions or a calibration alone
    return {};
  }
  return metrics::find_time_gaps(images, duration_s);
}

Warnings trajectory_gaps(const MapInputs& map) {
  const fs::path file = map.trajectory.empty() ? map.map / "trajectory.txt" : map.trajectory;
  if (map.trajectory.empty() && !fs::exists(file)) return {};
  const geometry::Trajectory trajectory = geometry::read_tum(file);
  if (trajectory.empty()) return {};
  const double duration_s = trajectory.poses.back().time_s - trajectory.poses.front().time_s;
  return gap_warnings(trajectory, duration_s, gaps_of_images(map.dataset, duration_s), kOdometry);
}

}  // namespace

Warnings read_warnings(const fs::path& json_file) {
  if (!fs::exists(json_file)) return {};
  const json object = json::parse(base::read_text(json_file), nullptr, false);
  if (!object.is_object()) return {};
  base::StrictSection section(object, json_file);
  return tileflight::read_warnings(section);
}

Warnings odometry_warnings(const MapInputs& map) {
  Warnings warnings;
  const fs::path file = map.map / "odometry.json";
  if (fs::is_directory(map.map) && fs::exists(file)) {
    const json about = json::parse(base::read_text(file), nullptr, false);
    append_distinct(warnings, read_warnings(file));
    append_distinct(warnings, trajectory_gaps(map));  // of any odometry: none lists them itself
    if (about.is_object() && about.contains("warnings"))
      return warnings;  // the built-in odometry lists the others itself
    if (about.is_object() && about.value("lost", false)) {
      const std::string why = text_of(about, "lost_reason");
      warnings.push_back({"the flight was not tracked to its end" + (why.empty() ? "" : ": " + why), kOdometry,
                          Severity::kError, "use the tracked part, or a flight that can be tracked throughout"});
    }
    if (about.is_object())
      check_tracking_gaps(number_of(about, "frames", 0.0), number_of(about, "frames_tracked", 0.0), warnings);
    return warnings;
  }
  append_distinct(warnings, trajectory_gaps(map));
  if (map.dataset.empty() || map.trajectory.empty()) return warnings;
  check_tracking_gaps(static_cast<double>(dataset::read_dataset(map.dataset).frames.size()),
                      static_cast<double>(geometry::read_tum(map.trajectory).size()), warnings);
  return warnings;
}

Warnings gap_warnings(const geometry::Trajectory& trajectory, double duration_s,
                      const std::vector<metrics::TimeGap>& unrecorded, const std::string& where) {
  const std::vector<metrics::TimeGap> gaps = metrics::find_time_gaps(trajectory, duration_s, unrecorded);
  if (gaps.empty()) return {};
  const metrics::TimeGap& longest = *std::ranges::max_element(gaps, {}, &metrics::TimeGap::missing_s);
  double missing_s = 0.0;
  for (const metrics::TimeGap& gap : gaps) missing_s += gap.missing_s;
  const std::string others = gaps.size() > 1 ? ", the longest of " + std::to_string(gaps.size()) + " gaps" : "";
  return {{base::formatted("no poses from %.2f to %.2f s", longest.from_s, longest.to_s) + others +
               base::formatted(": %.0f %% of the flight's time is missing in between, and its errors are in no number",
                               100.0 * missing_s / duration_s),
           where, Severity::kWarning,
           "look up what went wrong there; score the parts before and after it on their own"}};
}

Warnings truth_warnings(const place::ExtractResult& extracted) {
  Warnings warnings;
  if (!extracted.complete) {
    warnings.push_back({std::to_string(extracted.tiles_failed) + " of " + std::to_string(extracted.tiles_wanted) +
                            " tiles of the ground truth are missing",
                        kTruth, Severity::kError, "fetch the missing tiles and extract again"});
  }
  constexpr double kCoarse_m = 0.5;
  const double error_m = extracted.geometric_error_max_m.value_or(0.0);
  if (error_m > kCoarse_m) {
    std::string metres = std::to_string(error_m);
    metres.resize(metres.find('.') + 3);
    warnings.push_back({"the ground truth's tiles have a geometric error of up to " + metres + " m", kTruth,
                        Severity::kNote, "request finer tiles (--error), or treat distances below that as agreement"});
  }
  return warnings;
}

Warnings dataset_warnings(const fs::path& folder) {
  Warnings warnings;
  if (folder.empty()) return warnings;
  for (const render::FlightFault& fault : recording::faults_from_metadata(dataset::read_dataset(folder).metadata)) {
    const bool only_near = fault.key == "camera_near_surface" || fault.key == "no_surface_in_view";
    warnings.push_back({fault.what + " (frames " + recording::format_frame_ranges(fault.frames) + ")", "dataset",
                        only_near ? Severity::kNote : Severity::kWarning, "check those images and change the flight"});
  }
  return warnings;
}

Warnings moving_warnings(const metrics::MovingPoints& moving, double share_margin) {
  const auto apart = static_cast<double>(moving.apart.points), all = static_cast<double>(moving.with_them.points);
  if (!(apart > share_margin * all)) return {};
  return {{std::to_string(moving.apart.points) + " of the map's " + std::to_string(moving.with_them.points) +
               " points are on moving objects; they are left out of the scores, but odometry and alignment used them",
           "evaluation", Severity::kNote,
           "compare with_them of moving_objects in metrics.json; fly the place without actors"}};
}

Warnings common_place_warnings(const CommonPlace& place, std::size_t points, double share_margin) {
  if (place.points < 2 || !(static_cast<double>(place.points) > share_margin * static_cast<double>(points))) return {};
  std::ostringstream where;
  where << std::fixed << std::setprecision(2) << '[' << place.position.x() << ", " << place.position.y() << ", "
        << place.position.z() << ']';
  return {
      {std::to_string(place.points) + " of the map's " + std::to_string(points) +
           " points lie at one and the same place, " + where.str() + " in the local frame; they are in every score",
       "evaluation", Severity::kWarning,
       "leave points without a position out of the map: some systems write what they could not measure at the origin"}};
}

void append_distinct(Warnings& warnings, const Warnings& more) {
  for (const Warning& warning : more) {
    const auto same = [&](const Warning& d) { return d.message == warning.message && d.where == warning.where; };
    if (std::ranges::none_of(warnings, same)) warnings.push_back(warning);
  }
}

Warnings prefix_with_flight(Warnings warnings, const std::string& flight) {
  for (Warning& warning : warnings) warning.where = flight + "/" + warning.where;
  return warnings;
}

}  // namespace tileflight::scoring
