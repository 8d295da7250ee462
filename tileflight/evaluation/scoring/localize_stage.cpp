#include "tileflight/evaluation/scoring/localize_stage.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/json_numbers.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/localization/picture_localizer.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/align_target.h"
#include "tileflight/evaluation/scoring/flight_evidence.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/evaluation/scoring/warnings.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::scoring {

namespace fs = std::filesystem;
namespace {

using geometry::SE3;
using geometry::Vec3;
using localization::LocatedImage;
using localization::PoseSource;
using nlohmann::json;

constexpr double kDegreesOfRadian = 180.0 / std::numbers::pi;

// ------------------------------------------------------------------------------------------------------------- inputs

/// Chooses the surroundings of the receiver's positions as region, if none is given and the positions are known.
tileset::LoadOptions around_flight(tileset::LoadOptions load, const dataset::Dataset& dataset) {
  if (load.center || load.center_local || load.size || !load.areas.empty() || dataset.gps.empty()) return load;
  constexpr double kMargin_m = 200.0;  // a camera 60 m up that looks 70 degrees from the vertical sees that far
  const geometry::LocalFrame frame(dataset.gps.front().position);
  geometry::Box3 box;
  for (const dataset::GpsFix& fix : dataset.gps) box.extend(frame.local_from_geodetic(fix.position));
  geometry::Geodetic center = frame.geodetic_from_local(box.center());
  center.height.m = std::numeric_limits<double>::quiet_NaN();
  load.center = center;
  load.size = Vec3(box.sizes().x() + 2.0 * kMargin_m, box.sizes().y() + 2.0 * kMargin_m, 0.0);
  return load;
}

/// Returns the folder of the place's ground truth: the given one, or one made in `folder`.
fs::path ground_truth_of(const LocalizeSettings& settings, const dataset::Dataset& dataset, const fs::path& folder,
                         const Progress& progress) {
  if (fs::exists(fs::path(settings.place) / "extract.json")) return settings.place;
  place::ExtractSettings extract{.source = settings.place, .load = around_flight(settings.load, dataset)};
  place::extract(extract, folder / "place", false, progress);
  return folder / "place";
}

// ------------------------------------------------------------------------------------------------------------ results

/// Returns the trajectory of all images with a known pose.
geometry::Trajectory located_path(const LocalizeResult& result) {
  geometry::Trajectory path;
  for (std::size_t i = 0; i < result.times_s.size(); ++i) {
    if (result.flight.images[i].source == PoseSource::kLost) continue;
    path.poses.push_back({result.times_s[i], result.flight.images[i].pose.T_local_camera});
  }
  return path;
}

/// Returns the sigmas of the camera's position along the local axes.
Vec3 position_sigmas(const localization::FusedPose& pose) {
  const geometry::Mat3 R = pose.T_local_camera.rotation.toRotationMatrix();
  return (R * pose.covariance.topLeftCorner<3, 3>() * R.transpose()).diagonal().cwiseMax(0.0).cwiseSqrt();
}

double rotation_sigma_rad(const localization::FusedPose& pose) {
  return std::sqrt(std::max(0.0, pose.covariance.bottomRightCorner<3, 3>().trace()));
}

const char* word_of(PoseSource source) {
  switch (source) {
    case PoseSource::kPlace:
      return "place";
    case PoseSource::kOdometry:
      return "odometry";
    case PoseSource::kLost:
      break;
  }
  return "lost";
}

std::string quality_csv(const LocalizeResult& result) {
  std::string table =
      "frame,time_s,source,sigma_east_m,sigma_north_m,sigma_up_m,sigma_position_m,sigma_rotation_deg,correlation,"
      "share_in_view,deviation,scale\n";
  for (std::size_t i = 0; i < result.times_s.size(); ++i) {
    const LocatedImage& image = result.flight.images[i];
    table += result.frame_ids[i] + ',';
    base::append_number(table, result.times_s[i]);
    table += std::string(",") + word_of(image.source);
    const Vec3 sigmas = position_sigmas(image.pose);
    for (const double value :
         {sigmas.x(), sigmas.y(), sigmas.z(), sigmas.norm(), kDegreesOfRadian * rotation_sigma_rad(image.pose),
          image.correlation, image.share_in_view, image.pose.deviation, image.pose.scale})
      table += ',' + base::formatted("%.6g", value);
    table += '\n';
  }
  return table;
}

std::vector<LostPart> lost_parts(const LocalizeResult& result) {
  std::vector<LostPart> parts;
  bool was_lost = false;
  for (std::size_t i = 0; i < result.times_s.size(); ++i) {
    const bool is_lost = result.flight.images[i].source == PoseSource::kLost;
    if (is_lost && !was_lost) parts.push_back({.from_s = result.times_s[i]});
    if (is_lost) {
      parts.back().to_s = result.times_s[i];
      ++parts.back().images;
    }
    was_lost = is_lost;
  }
  return parts;
}

std::optional<ReceiverComparison> compare_with_receiver(const LocalizeResult& result, const dataset::Dataset& dataset) {
  if (dataset.gps.empty() || !result.origin) return std::nullopt;
  const geometry::LocalFrame frame(*result.origin);
  const geometry::Trajectory path = located_path(result);
  ReceiverComparison compared;
  double squares = 0.0, stated = 0.0;
  for (const dataset::GpsFix& fix : dataset.gps) {
    const auto pose = geometry::interpolate(path, fix.time_s);
    if (!pose) continue;
    const Vec3 apart = pose->translation - frame.local_from_geodetic(fix.position);
    ++compared.positions;
    compared.mean_m += apart;
    squares += apart.squaredNorm();
    stated += 2.0 * fix.horizontal_sigma_m * fix.horizontal_sigma_m + fix.vertical_sigma_m * fix.vertical_sigma_m;
  }
  if (compared.positions == 0) return std::nullopt;
  const auto n = static_cast<double>(compared.positions);
  compared.mean_m /= n;
  compared.rms_m = std::sqrt(squares / n);
  compared.stated_sigma_m = std::sqrt(stated / n);
  return compared;
}

// ----------------------------------------------------------------------------------------------------------- warnings

double median_correlation(const LocalizeResult& result) {
  std::vector<double> values;
  for (const LocatedImage& image : result.flight.images)
    if (image.source == PoseSource::kPlace) values.push_back(image.correlation);
  return values.empty() ? 0.0 : base::upper_median(std::move(values));
}

std::string percent(std::size_t part, std::size_t whole) {
  return base::formatted("%.0f %%",
                         100.0 * static_cast<double>(part) / static_cast<double>(std::max<std::size_t>(1, whole)));
}

Warnings flight_warnings(const LocalizeResult& result) {
  constexpr double kFewLocated = 0.5, kMostLocated = 0.8, kFewLost = 0.05, kManyContradict = 0.1;
  constexpr double kNoisy = 2.5, kReceiverSigmas = 3.0;
  const std::size_t images = result.times_s.size(), located = result.count(PoseSource::kPlace),
                    lost = result.count(PoseSource::kLost);
  const auto share = [&](std::size_t part) { return static_cast<double>(part) / static_cast<double>(images); };
  Warnings warnings;
  if (share(located) < kMostLocated) {
    warnings.push_back({"only " + percent(located, images) +
                            " of the images were located in the place; the others' poses are the "
                            "odometry's between them",
                        "localization", share(located) < kFewLocated ? Severity::kWarning : Severity::kNote,
                        "look up in quality.csv which; tiles of another year or season, water, sky and darkness show "
                        "nothing to compare"});
  }
  if (lost > 0) {
    const LostPart& longest = *std::ranges::max_element(result.lost, {}, &LostPart::images);
    warnings.push_back({base::formatted("%zu of %zu images have no known pose, most of them from %.2f to %.2f s", lost,
                                        images, longest.from_s, longest.to_s),
                        "localization", share(lost) > kFewLost ? Severity::kWarning : Severity::kNote,
                        "they are not in trajectory.txt"});
  }
  const auto contradicting =
      static_cast<std::size_t>(std::ranges::count_if(result.flight.images, &LocatedImage::contradicts));
  if (share(contradicting) > kManyContradict) {
    warnings.push_back({percent(contradicting, images) + " of the images were located where the other images and the "
                                                         "odometry do not allow it",
                        "localization", Severity::kWarning,
                        "the place may repeat itself, or the odometry may be wrong: compare with its warnings"});
  }
  if (result.flight.noise > kNoisy) {
    warnings.push_back({base::formatted("located poses scatter by %.1f times their own sigmas about the path; the "
                                        "sigmas are enlarged by it",
                                        result.flight.noise),
                        "localization", Severity::kNote, "check the calibration, and how the odometry went"});
  }
  if (result.receiver && result.receiver->rms_m > kReceiverSigmas * std::max(0.01, result.receiver->stated_sigma_m)) {
    const ReceiverComparison& r = *result.receiver;
    warnings.push_back(
        {base::formatted("the receiver's positions are %.2f m from the located path (RMS; mean %.2f, %.2f, %.2f m "
                         "east, north, up), where they state %.2f m",
                         r.rms_m, r.mean_m.x(), r.mean_m.y(), r.mean_m.z(), r.stated_sigma_m),
         "localization", Severity::kWarning,
         "check the height's datum, the clock and the tileset's position; the path is relative to the tiles"});
  }
  return warnings;
}

/// States where the flight is before its images are located.
struct FlightStart {
  geometry::Sim3 T_local_map;
  Warnings warnings;          ///< of odometry and registration
  bool is_ambiguous = false;  ///< the images fit elsewhere, too
};

FlightStart register_flight_start(const LocalizeSettings& settings, const MapInputs& map, const fs::path& truth,
                                  const fs::path& folder, const Progress& progress) {
  if (!settings.transform.empty()) {
    const ScoringTransform given = read_scoring_transform(settings.transform);
    return {given.T_surface_map, given.warnings};
  }
  const AlignResult aligned = align(map, truth, settings.align, folder / "transform.json", progress);
  FlightStart start{aligned.T_local_map(), aligned.warnings};
  if (const auto* registered = std::get_if<RegisteredFlight>(&aligned.found)) {
    const registration::RegistrationResult& r = registered->registration;
    start.is_ambiguous = r.repetition_distance_m || r.similar_place_distance_m;
  }
  return start;
}

/// Returns the warnings of the odometry and of its registration. They become notes where the images, each located on
/// its own, confirm both.
Warnings start_warnings(const LocalizeResult& result, const FlightStart& start) {
  constexpr double kMost = 0.8, kFew = 0.1;
  const auto images = static_cast<double>(result.times_s.size());
  const auto contradicting = std::ranges::count_if(result.flight.images, &LocatedImage::contradicts);
  Warnings warnings = start.warnings;
  if (start.is_ambiguous || static_cast<double>(result.count(PoseSource::kPlace)) < kMost * images ||
      static_cast<double>(contradicting) > kFew * images)
    return warnings;
  for (Warning& warning : warnings) warning.severity = Severity::kNote;
  return warnings;
}

json to_json(const LostPart& part) { return {{"from_s", part.from_s}, {"to_s", part.to_s}, {"images", part.images}}; }

}  // namespace

std::size_t LocalizeResult::count(PoseSource source) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(flight.images, [&](const LocatedImage& image) { return image.source == source; }));
}

json to_json(const LocalizeResult& result) {
  std::vector<double> position_m, rotation_deg;
  for (const LocatedImage& image : result.flight.images) {
    if (image.source == PoseSource::kLost) continue;
    position_m.push_back(position_sigmas(image.pose).norm());
    rotation_deg.push_back(kDegreesOfRadian * rotation_sigma_rad(image.pose));
  }
  const auto median_of = [](std::vector<double>& values) {
    return values.empty() ? json() : json(base::median(values));
  };
  json lost = json::array();
  for (const LostPart& part : result.lost) lost.push_back(to_json(part));
  json about = {
      {"images", result.times_s.size()},
      {"located", result.count(PoseSource::kPlace)},
      {"bridged", result.count(PoseSource::kOdometry)},
      {"lost", lost},
      {"sigma_position_m", median_of(position_m)},
      {"sigma_rotation_deg", median_of(rotation_deg)},
      {"correlation", median_correlation(result)},
      {"noise", result.flight.noise},
      {"renderings", result.flight.renderings},
      {"frame", nullptr},
      {"receiver", nullptr},
      {"warnings", tileflight::to_json(result.warnings)},
      {"seconds", {{"locate", result.locate_seconds}, {"total", result.seconds}}},
      {"images_per_second",
       result.locate_seconds > 0.0 ? static_cast<double>(result.times_s.size()) / result.locate_seconds : 0.0}};
  if (result.origin) {
    about["frame"] = {{"origin_lat", result.origin->latitude_deg},
                      {"origin_lon", result.origin->longitude_deg},
                      {"origin_height", result.origin->height.m}};
  }
  if (result.receiver) {
    about["receiver"] = {{"positions", result.receiver->positions},
                         {"rms_m", result.receiver->rms_m},
                         {"mean_m", geometry::json_numbers(result.receiver->mean_m)},
                         {"stated_sigma_m", result.receiver->stated_sigma_m}};
  }
  return about;
}

LocalizeResult localize(const LocalizeSettings& settings, const fs::path& out, bool replace, const Progress& progress) {
  const auto start = std::chrono::steady_clock::now();
  LocalizeResult result;
  const base::OutputFolder output{
      .folder = out,
      .command = "localize",
      .replace = replace,
      .inputs = {settings.dataset, settings.odometry, fetch::local_path_of_source(settings.place)}};
  base::require_writable(output);
  const dataset::Dataset dataset = dataset::read_dataset(settings.dataset);
  base::write_folder(output, [&](const fs::path& folder) {
    const fs::path truth = ground_truth_of(settings, dataset, folder, progress);
    fs::path odometry = settings.odometry;
    if (odometry.empty()) {
      odometry = folder / "odometry";
      const odometry::TrackResult tracked =
          odometry::track(settings.dataset, odometry, false, settings.track, progress);
      if (tracked.odometry.frames_tracked == 0)
        throw InputError(settings.dataset.string(), "the odometry found no motion: " + tracked.odometry.lost_reason);
    }
    const MapInputs map = find_map_inputs(odometry, settings.dataset);
    if (map.trajectory.empty()) throw InputError(odometry.string(), "has no trajectory.txt");
    const FlightStart flight_start = register_flight_start(settings, map, truth, folder, progress);
    result.T_local_map = flight_start.T_local_map;

    const AlignTarget target = read_align_target(truth);
    result.origin = target.origin;
    const TexturedPlace place = read_textured_place(target.mesh_files, true);
    if (!place.textured)
      throw InputError(settings.place, "the place has no textures, by which images could be located");
    const auto before = std::chrono::steady_clock::now();
    const localization::PictureLocalizer localizer(*place.scene, dataset.calibration.camera, {.width = settings.width});
    result.flight =
        localization::locate_flight(localizer, flight_images(dataset, map), result.T_local_map, {}, progress);
    result.locate_seconds = base::seconds_since(before);
    for (const dataset::Frame& frame : dataset.frames) {
      result.frame_ids.push_back(frame.id);
      result.times_s.push_back(frame.time_s);
    }
    result.lost = lost_parts(result);
    result.receiver = compare_with_receiver(result, dataset);
    result.warnings = start_warnings(result, flight_start);
    append_distinct(result.warnings, flight_warnings(result));
    geometry::write_tum(folder / "trajectory.txt", located_path(result));
    base::write_file(folder / "quality.csv", quality_csv(result));
    result.seconds = base::seconds_since(start);
    base::write_file(folder / "localize.json", to_json(result).dump(2) + "\n");
  });
  return result;
}

std::vector<alignment::PositionFix> read_located_positions(const fs::path& folder) {
  const fs::path file = folder / "quality.csv";
  const geometry::Trajectory path = geometry::read_tum(folder / "trajectory.txt");
  const std::string text = base::read_text(file);
  std::string_view rest = text;
  const std::vector<std::string_view> head = base::split_fields(base::take_line(rest).value_or(""), ",");
  std::vector<alignment::PositionFix> fixes;
  for (std::size_t line_number = 2; const auto line = base::take_line(rest); ++line_number) {
    const std::vector<std::string_view> fields = base::split_fields(*line, ",");
    const auto number = [&](std::string_view name) {
      const auto at = static_cast<std::size_t>(std::ranges::find(head, name) - head.begin());
      const auto value = at < fields.size() ? base::parse_number<double>(fields[at]) : std::nullopt;
      if (!value)
        throw InputError(file.string() + ", line " + std::to_string(line_number),
                         "has no number in the column " + std::string(name));
      return *value;
    };
    const double time_s = number("time_s");
    constexpr double kSameTime_s = 1e-4;
    const auto pose = std::ranges::lower_bound(path.poses, time_s - kSameTime_s, {}, &geometry::StampedPose::time_s);
    if (pose == path.poses.end() || pose->time_s > time_s + kSameTime_s) continue;  // lost
    fixes.push_back({time_s, pose->T_local_camera.translation,
                     std::sqrt(0.5) * std::hypot(number("sigma_east_m"), number("sigma_north_m")),
                     number("sigma_up_m")});
  }
  return fixes;
}

}  // namespace tileflight::scoring
