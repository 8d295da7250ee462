#include "tileflight/capture/ingest/telemetry_positions.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/world/ground_truth/truth_folder.h"
#include "tileflight/world/place/extract.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::ingest {

namespace {

using geometry::Vec3;

constexpr double kMaxGroundHeight_m = 2.0;  ///< typical barometer drift before take-off
constexpr double kSampleRadius_m = 2.0;
constexpr int kSteps = 2;  ///< grid steps on each side

const flight_logs::TelemetryFix& find_ground_fix(const flight_logs::Telemetry& telemetry,
                                                 const std::filesystem::path& log) {
  const auto found = std::ranges::find_if(telemetry.fixes, [](const flight_logs::TelemetryFix& fix) {
    return fix.height_above_takeoff_m && *fix.height_above_takeoff_m <= kMaxGroundHeight_m;
  });
  if (found != telemetry.fixes.end()) return *found;
  throw InputError(log.string(),
                   "has no position within 2 m of its take-off height, so the take-off point is unknown; give its "
                   "height: --takeoff-height (takeoff_height in an experiment)");
}

/// Heights of the uppermost surface on a grid around a position; empty without a surface.
std::vector<double> surface_heights(const scene::Scene& scene, const Vec3& place) {
  const double top = scene.bounds().max().z() + 1.0;
  std::vector<double> heights;
  for (int j = -kSteps; j <= kSteps; ++j) {
    for (int i = -kSteps; i <= kSteps; ++i) {
      const Vec3 above(place.x() + kSampleRadius_m * i / kSteps, place.y() + kSampleRadius_m * j / kSteps, top);
      if (const auto hit = scene.intersect({above, -Vec3::UnitZ()})) heights.push_back(top - hit->distance_m);
    }
  }
  return heights;
}

}  // namespace

geometry::EllipsoidalHeight estimate_takeoff_height(const flight_logs::Telemetry& telemetry,
                                                    const std::filesystem::path& log,
                                                    const std::filesystem::path& truth) {
  const flight_logs::TelemetryFix& fix = find_ground_fix(telemetry, log);
  const auto origin = place::read_extract_json(truth).origin;
  if (!origin) {
    throw InputError(truth.string(),
                     "is not georeferenced, so the take-off point cannot be located in it; give its height: "
                     "--takeoff-height (takeoff_height in an experiment)");
  }
  geometry::TriangleMesh mesh = ground_truth::read_ground_truth(truth).mesh;
  if (mesh.triangles.empty())
    throw InputError(truth.string(), "has no surface to take the height of the take-off point from");
  std::vector<imaging::TexturedMesh> meshes(1);
  meshes[0].mesh = std::move(mesh);
  const scene::Scene scene(std::move(meshes));
  const geometry::LocalFrame frame(*origin);
  const Vec3 place = frame.local_from_geodetic({fix.latitude_deg, fix.longitude_deg, origin->height});
  const std::vector<double> heights = surface_heights(scene, place);
  if (heights.empty()) {
    throw InputError(log.string(),
                     "took off outside the ground truth; give the height of the take-off point: --takeoff-height "
                     "(takeoff_height in an experiment), or extract a larger region");
  }
  const Vec3 ground(place.x(), place.y(), base::upper_median(heights));
  return {frame.geodetic_from_local(ground).height.m - *fix.height_above_takeoff_m};
}

namespace {

/// Typical accuracy of consumer drones' receivers under open sky, for logs that do not state it.
constexpr double kHorizontalSigma_m = 1.0;
constexpr double kVerticalSigma_m = 2.0;
/// Accuracy of EGM96's heights of the geoid (NIMA TR8350.2, section 6: 0.5 to 1 m).
constexpr double kGeoidSigma_m = 0.5;

enum class HeightReference { kEllipsoid, kSeaLevel, kTakeoff };

HeightReference find_height_reference(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight) {
  if (flight.telemetry_height == "takeoff") return HeightReference::kTakeoff;
  if (flight.telemetry_height == "ellipsoid") return HeightReference::kEllipsoid;
  if (flight.telemetry_height == "sea-level") return HeightReference::kSeaLevel;
  if (telemetry.height_datum == flight_logs::HeightDatum::kEllipsoid) return HeightReference::kEllipsoid;
  if (telemetry.height_datum == flight_logs::HeightDatum::kMeanSeaLevel) return HeightReference::kSeaLevel;
  throw InputError(flight.telemetry.string(),
                   "does not state its height reference; give --telemetry-height (telemetry_height in an experiment) "
                   "ellipsoid, sea-level or takeoff");
}

/// Notes a --telemetry-height that contradicts the reference which the log states.
void note_other_reference(const flight_logs::Telemetry& telemetry, HeightReference above,
                          std::vector<std::string>& warnings) {
  using flight_logs::HeightDatum;
  if (!telemetry.height_datum_note.empty()) return;  // the log does not state one
  const bool by_ellipsoid = telemetry.height_datum == HeightDatum::kEllipsoid && above == HeightReference::kSeaLevel;
  const bool by_sea = telemetry.height_datum == HeightDatum::kMeanSeaLevel && above == HeightReference::kEllipsoid;
  if (!by_ellipsoid && !by_sea) return;
  warnings.push_back(
      "the flight log states heights above " + std::string(by_sea ? "sea level" : "the ellipsoid") +
      ", but --telemetry-height " + (by_sea ? "ellipsoid" : "sea-level") +
      " is used, which moves the flight by the height of the geoid: leave it out unless the log is wrong");
}

/// nullopt if the fix has no height of that kind.
std::optional<geometry::EllipsoidalHeight> ellipsoidal_height(const flight_logs::TelemetryFix& fix,
                                                              HeightReference above,
                                                              const IngestedFlightConfig& flight) {
  if (above == HeightReference::kTakeoff) {
    if (!fix.height_above_takeoff_m) return {};
    return geometry::EllipsoidalHeight{flight.takeoff_height_m.value() + *fix.height_above_takeoff_m};
  }
  if (!fix.absolute_height_m) return {};
  if (above == HeightReference::kEllipsoid) return geometry::EllipsoidalHeight{*fix.absolute_height_m};
  return geometry::ellipsoidal_from_orthometric(fix.latitude_deg, fix.longitude_deg, {*fix.absolute_height_m});
}

/// Standard deviation of ellipsoidal_height(): what the log states is of its absolute height.
double height_sigma_m(const flight_logs::TelemetryFix& fix, HeightReference above) {
  if (!fix.vertical_sigma_m || above == HeightReference::kTakeoff) return kVerticalSigma_m;
  return above == HeightReference::kSeaLevel ? std::hypot(*fix.vertical_sigma_m, kGeoidSigma_m) : *fix.vertical_sigma_m;
}

}  // namespace

std::vector<dataset::GpsFix> to_gps_fixes(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight,
                                          std::vector<std::string>& warnings) {
  const HeightReference above = find_height_reference(telemetry, flight);
  if (above == HeightReference::kTakeoff && !flight.takeoff_height_m) {
    throw InputError(flight.telemetry.string(),
                     "heights above take-off need --takeoff-height (takeoff_height), the height of the take-off point "
                     "above the ellipsoid in metres, or a ground truth to take it from (--truth)");
  }
  note_other_reference(telemetry, above, warnings);
  if (flight.telemetry_height.empty() && !telemetry.height_datum_note.empty())
    warnings.push_back(telemetry.height_datum_note);
  std::vector<dataset::GpsFix> fixes;
  std::size_t without_height = 0;
  for (const flight_logs::TelemetryFix& fix : flight_logs::distinct_fixes(telemetry)) {
    const auto height = ellipsoidal_height(fix, above, flight);
    if (!height) {
      ++without_height;
      continue;
    }
    fixes.push_back({.time_s = fix.time_s,
                     .position = {fix.latitude_deg, fix.longitude_deg, *height},
                     .horizontal_sigma_m = fix.horizontal_sigma_m.value_or(kHorizontalSigma_m),
                     .vertical_sigma_m = height_sigma_m(fix, above)});
  }
  const bool has_no_heights = std::ranges::none_of(telemetry.fixes, [](const flight_logs::TelemetryFix& fix) {
    return fix.absolute_height_m.has_value() || fix.height_above_takeoff_m.has_value();
  });
  if (has_no_heights)
    throw InputError(flight.telemetry.string(),
                     "has no heights at all, only latitudes and longitudes; its positions "
                     "cannot be used" +
                         (telemetry.warnings.empty() ? "" : " (" + base::joined(telemetry.warnings) + ")"));
  if (fixes.empty() && above == HeightReference::kTakeoff)
    throw InputError(flight.telemetry.string(), "has no heights above take-off");
  if (fixes.empty()) {
    throw InputError(flight.telemetry.string(),
                     "has no absolute heights; give --telemetry-height takeoff and --takeoff-height (telemetry_height "
                     "and takeoff_height in an experiment)");
  }
  if (without_height > 0)
    warnings.push_back(std::to_string(without_height) +
                       " positions of the flight log left out: they have no height of that kind");
  return fixes;
}

std::string height_reference_name(const flight_logs::Telemetry& telemetry, const IngestedFlightConfig& flight) {
  const HeightReference above = find_height_reference(telemetry, flight);
  return above == HeightReference::kTakeoff     ? "takeoff"
         : above == HeightReference::kEllipsoid ? "ellipsoid"
                                                : "sea-level";
}

LoggedFlight describe_flight(const std::vector<dataset::GpsFix>& fixes) {
  constexpr double kSpeedOver_s = 1.0;
  const geometry::LocalFrame frame(fixes.front().position);
  const std::vector<geometry::Vec3> positions = to_local_positions(fixes, frame);
  LoggedFlight flight{.duration_s = fixes.back().time_s - fixes.front().time_s,
                      .lowest_m = fixes.front().position.height.m,
                      .highest_m = fixes.front().position.height.m};
  const double speed_over_s = std::min(kSpeedOver_s, flight.duration_s);  // a shorter flight has one speed
  for (std::size_t i = 1, from = 0; i < fixes.size(); ++i) {
    flight.length_m += (positions[i] - positions[i - 1]).norm();
    flight.lowest_m = std::min(flight.lowest_m, fixes[i].position.height.m);
    flight.highest_m = std::max(flight.highest_m, fixes[i].position.height.m);
    while (from + 1 < i && fixes[i].time_s - fixes[from + 1].time_s >= speed_over_s) ++from;
    const double seconds = fixes[i].time_s - fixes[from].time_s;
    if (seconds < speed_over_s || !(seconds > 0.0)) continue;
    flight.largest_speed_m_s = std::max(flight.largest_speed_m_s, (positions[i] - positions[from]).norm() / seconds);
  }
  return flight;
}

std::vector<std::string> find_implausible(const LoggedFlight& flight, const std::vector<dataset::GpsFix>& fixes) {
  constexpr double kFastest_m_s = 60.0, kLowest_m = -450.0, kHighest_m = 9000.0, kDay_s = 86400.0;
  constexpr std::size_t kSeveral = 10;
  std::vector<std::string> found;
  if (flight.largest_speed_m_s > kFastest_m_s)
    found.push_back(
        base::formatted("the flight log moves at up to %.0f m/s, faster than drones fly: check its units, "
                        "columns and order",
                        flight.largest_speed_m_s));
  if (flight.lowest_m < kLowest_m || flight.highest_m > kHighest_m)
    found.push_back(
        base::formatted("the flight log's heights reach from %.0f to %.0f m above the ellipsoid: check their "
                        "unit and reference",
                        flight.lowest_m, flight.highest_m));
  if (flight.duration_s > kDay_s)
    found.push_back(base::formatted("the flight log lasts for %.0f hours: check the unit of its times",
                                    flight.duration_s / 3600.0));
  const bool has_one_place = std::ranges::all_of(fixes, [&](const dataset::GpsFix& fix) {
    return fix.position.latitude_deg == fixes.front().position.latitude_deg &&
           fix.position.longitude_deg == fixes.front().position.longitude_deg;
  });
  if (has_one_place && fixes.size() >= kSeveral)
    found.push_back("all " + std::to_string(fixes.size()) +
                    " positions of the flight log have one latitude and longitude: check whether its numbers are cut");
  return found;
}

std::vector<dataset::CameraAttitude> to_camera_attitudes(const flight_logs::Telemetry& telemetry) {
  constexpr double kTiltSigma_deg = 2.0, kYawSigma_deg = 6.0;  // not stated in logs
  std::vector<dataset::CameraAttitude> attitudes;
  for (const flight_logs::TelemetryFix& fix : telemetry.fixes) {
    if (!fix.gimbal_yaw_deg || !fix.gimbal_pitch_deg) continue;
    attitudes.push_back(
        {fix.time_s,
         flight_path::camera_orientation(*fix.gimbal_yaw_deg, *fix.gimbal_pitch_deg, fix.gimbal_roll_deg.value_or(0.0)),
         kTiltSigma_deg, kYawSigma_deg});
  }
  return attitudes;
}

std::vector<geometry::Vec3> to_local_positions(const std::vector<dataset::GpsFix>& fixes,
                                               const geometry::LocalFrame& frame) {
  std::vector<geometry::Vec3> positions;
  positions.reserve(fixes.size());
  for (const dataset::GpsFix& fix : fixes) positions.push_back(frame.local_from_geodetic(fix.position));
  return positions;
}

}  // namespace tileflight::ingest
