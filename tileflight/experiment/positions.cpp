#include "tileflight/experiment/positions.h"

#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace {

/// What consumer receivers of drones reach under open sky; logs do not say it.
constexpr double kHorizontalSigma_m = 1.0;
constexpr double kVerticalSigma_m = 2.0;

std::string height_datum(const flight::Telemetry& telemetry, const IngestFlight& flight) {
  if (!flight.telemetry_height.empty()) return flight.telemetry_height;
  if (telemetry.height_datum == flight::HeightDatum::kEllipsoid) return "ellipsoid";
  if (telemetry.height_datum == flight::HeightDatum::kMeanSeaLevel) return "sea-level";
  throw InputError(flight.telemetry.string(),
                   "does not say what its heights are above; set telemetry_height to ellipsoid, sea-level or takeoff");
}

double absolute_height(const flight::TelemetryFix& fix, const IngestFlight& flight) {
  if (fix.absolute_height_m) return *fix.absolute_height_m;
  throw InputError(flight.telemetry.string(),
                   "has no absolute heights; set telemetry_height to takeoff, and takeoff_height");
}

geometry::EllipsoidalHeight ellipsoidal_height(const flight::TelemetryFix& fix, const std::string& datum,
                                               const IngestFlight& flight) {
  if (datum == "ellipsoid") return {absolute_height(fix, flight)};
  if (datum == "sea-level") {
    return geometry::ellipsoidal_from_orthometric(fix.latitude_deg, fix.longitude_deg, {absolute_height(fix, flight)});
  }
  if (!flight.takeoff_height_m) {
    throw InputError(flight.telemetry.string(),
                     "heights above take-off need takeoff_height, the take-off place's metres above the ellipsoid");
  }
  if (!fix.height_above_takeoff_m) throw InputError(flight.telemetry.string(), "has no heights above take-off");
  return {*flight.takeoff_height_m + *fix.height_above_takeoff_m};
}

}  // namespace

std::vector<dataset::GpsFix> gps_fixes(const flight::Telemetry& telemetry, const IngestFlight& flight) {
  const std::string datum = height_datum(telemetry, flight);
  std::vector<dataset::GpsFix> fixes;
  for (const flight::TelemetryFix& fix : flight::distinct_fixes(telemetry)) {
    fixes.push_back({.time_s = fix.time_s,
                     .place = {fix.latitude_deg, fix.longitude_deg, ellipsoidal_height(fix, datum, flight)},
                     .horizontal_sigma_m = kHorizontalSigma_m,
                     .vertical_sigma_m = kVerticalSigma_m});
  }
  return fixes;
}

std::vector<geometry::Vec3> local_positions(const std::vector<dataset::GpsFix>& fixes,
                                            const geometry::LocalFrame& frame) {
  std::vector<geometry::Vec3> positions;
  positions.reserve(fixes.size());
  for (const dataset::GpsFix& fix : fixes) positions.push_back(frame.local_from_geodetic(fix.place));
  return positions;
}

}  // namespace tileflight::experiment
