#include "tileflight/capture/ingest/telemetry_positions.h"

#include <gmock/gmock.h>

#include <fstream>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/tiles/mesh_files/mesh_source.h"
#include "tileflight/tiles/tile_writer/mesh_tileset.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::ingest::telemetry_positions_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// Two positions in Timbuktu: one with an absolute height, one with both.
flight_logs::Telemetry log_of_two(flight_logs::HeightDatum datum) {
  flight_logs::Telemetry log;
  log.height_datum = datum;
  log.fixes.resize(2);
  log.fixes[0] = {.time_s = 1, .latitude_deg = 16.775833, .longitude_deg = -3.009444, .absolute_height_m = 120};
  log.fixes[1] = {.time_s = 2, .latitude_deg = 16.776833, .longitude_deg = -3.009444, .absolute_height_m = 121};
  log.fixes[1].height_above_takeoff_m = 15;
  return log;
}

class TelemetryPositions : public testing::Test {
 protected:
  std::vector<dataset::GpsFix> fixes(flight_logs::HeightDatum datum) {
    return to_gps_fixes(log_of_two(datum), flight_, warnings_);
  }
  std::string refusal(const flight_logs::Telemetry& log) {
    return tests::refusal_of([&] { to_gps_fixes(log, flight_, warnings_); });
  }

  IngestedFlightConfig flight_;
  std::vector<std::string> warnings_;
};

TEST_F(TelemetryPositions, TheDatumIsTheLogsUnlessItIsStated) {
  EXPECT_EQ(fixes(flight_logs::HeightDatum::kEllipsoid).front().position.height.m, 120);
  const double sea_level_m = fixes(flight_logs::HeightDatum::kMeanSeaLevel).front().position.height.m;
  EXPECT_NEAR(sea_level_m, 120 + 28.7068, 0.1) << "EGM96 as GeographicLib's manual of GeoidEval has it there";
  EXPECT_THAT(warnings_, IsEmpty());
  flight_.telemetry_height = "ellipsoid";
  EXPECT_EQ(fixes(flight_logs::HeightDatum::kMeanSeaLevel).front().position.height.m, 120);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("states heights above sea level, but --telemetry-height ellipsoid")));
}

/// NMEA's heights with the geoid's height beside them are those above the ellipsoid.
TEST_F(TelemetryPositions, AGeoidThatWouldBeAddedTwiceIsNamed) {
  flight_.telemetry_height = "sea-level";
  EXPECT_NEAR(fixes(flight_logs::HeightDatum::kEllipsoid).front().position.height.m, 120 + 28.7068, 0.1);
  EXPECT_THAT(warnings_,
              ElementsAre(HasSubstr("states heights above the ellipsoid, but --telemetry-height sea-level")));
  warnings_.clear();
  EXPECT_EQ(fixes(flight_logs::HeightDatum::kUnknown).size(), 2U);
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(TelemetryPositions, HaveTheStandardDeviationsThatTheLogStates) {
  flight_logs::Telemetry log = log_of_two(flight_logs::HeightDatum::kEllipsoid);
  log.fixes[1].horizontal_sigma_m = 0.012;
  log.fixes[1].vertical_sigma_m = 0.021;
  const auto fixes = to_gps_fixes(log, flight_, warnings_);
  EXPECT_EQ(fixes[0].horizontal_sigma_m, 1.0) << "the usual one, since the log does not state it";
  EXPECT_EQ(fixes[0].vertical_sigma_m, 2.0);
  EXPECT_EQ(fixes[1].horizontal_sigma_m, 0.012);
  EXPECT_EQ(fixes[1].vertical_sigma_m, 0.021);
  log.height_datum = flight_logs::HeightDatum::kMeanSeaLevel;
  EXPECT_NEAR(to_gps_fixes(log, flight_, warnings_)[1].vertical_sigma_m, 0.5004, 1e-4) << "the geoid's half metre";
  flight_.telemetry_height = "takeoff";
  flight_.takeoff_height_m = 100;
  EXPECT_EQ(to_gps_fixes(log, flight_, warnings_).at(0).vertical_sigma_m, 2.0) << "the barometer's height";
}

TEST_F(TelemetryPositions, AConcludedDatumIsNamedUnlessItIsGiven) {
  flight_logs::Telemetry log = log_of_two(flight_logs::HeightDatum::kEllipsoid);
  log.height_datum_note = "by RtkFlag";
  to_gps_fixes(log, flight_, warnings_);
  EXPECT_THAT(warnings_, ElementsAre("by RtkFlag"));
  warnings_.clear();
  flight_.telemetry_height = "sea-level";
  to_gps_fixes(log, flight_, warnings_);
  EXPECT_THAT(warnings_, IsEmpty());
}

TEST_F(TelemetryPositions, ALogWithoutAnyHeightsSaysSo) {
  flight_logs::Telemetry log = log_of_two(flight_logs::HeightDatum::kMeanSeaLevel);
  for (flight_logs::TelemetryFix& fix : log.fixes) fix.absolute_height_m = fix.height_above_takeoff_m = std::nullopt;
  EXPECT_THAT(refusal(log), HasSubstr("has no heights at all"));
  log.warnings = {"the absolute height is 0 in every entry"};
  EXPECT_THAT(refusal(log), HasSubstr("cannot be used (the absolute height is 0 in every entry)"));
}

TEST(LoggedFlight, IsDescribedAndCheckedForWrongUnits) {
  const auto flight_of = [](double metres_a_second, double height_m) {
    std::vector<dataset::GpsFix> fixes;
    for (int i = 0; i <= 100; ++i) {
      const double north_deg = 0.1 * i * metres_a_second / 110574.0;  // at the equator
      fixes.push_back({.time_s = 0.1 * i, .position = {north_deg, 10.0, {height_m + 0.05 * i}}});
    }
    return fixes;
  };
  const std::vector<dataset::GpsFix> usual = flight_of(8.0, 500.0);
  const LoggedFlight flight = describe_flight(usual);
  EXPECT_NEAR(flight.duration_s, 10.0, 1e-9);
  EXPECT_NEAR(flight.length_m, 80.2, 0.5);
  EXPECT_NEAR(flight.largest_speed_m_s, 8.02, 0.05);
  EXPECT_DOUBLE_EQ(flight.lowest_m, 500.0);
  EXPECT_DOUBLE_EQ(flight.highest_m, 505.0);
  EXPECT_THAT(find_implausible(flight, usual), IsEmpty());

  const auto faults_of = [](const std::vector<dataset::GpsFix>& fixes) {
    return find_implausible(describe_flight(fixes), fixes);
  };
  EXPECT_THAT(faults_of(flight_of(800.0, 500.0)), ElementsAre(HasSubstr("faster than drones fly")));
  EXPECT_THAT(faults_of(flight_of(8.0, 11914.0)), ElementsAre(HasSubstr("heights reach from 11914")));
  EXPECT_THAT(faults_of(flight_of(0.0, 500.0)), ElementsAre(HasSubstr("one latitude and longitude")));
  std::vector<dataset::GpsFix> fast = usual;
  for (dataset::GpsFix& fix : fast) fix.time_s *= 1e-3;  // shorter than the second over which speeds are measured
  EXPECT_THAT(faults_of(fast), ElementsAre(HasSubstr("faster than drones fly")));
  std::vector<dataset::GpsFix> slow = usual;
  for (dataset::GpsFix& fix : slow) fix.time_s *= 1e9;
  EXPECT_THAT(faults_of(slow), ElementsAre(HasSubstr("hours: check the unit of its times")));
}

TEST_F(TelemetryPositions, PositionsWithoutThatHeightAreLeftOutAndCounted) {
  flight_.telemetry_height = "takeoff";
  flight_.takeoff_height_m = 100;
  const auto kept = fixes(flight_logs::HeightDatum::kUnknown);
  ASSERT_EQ(kept.size(), 1U);
  EXPECT_EQ(kept[0].time_s, 2);
  EXPECT_EQ(kept[0].position.height.m, 115);
  EXPECT_THAT(warnings_, ElementsAre(HasSubstr("1 positions")));
}

TEST_F(TelemetryPositions, WhatIsNotKnownIsRefused) {
  flight_logs::Telemetry log = log_of_two(flight_logs::HeightDatum::kUnknown);
  EXPECT_THAT(refusal(log), HasSubstr("--telemetry-height"));
  flight_.telemetry_height = "takeoff";
  EXPECT_THAT(refusal(log), HasSubstr("--takeoff-height"));
  flight_.takeoff_height_m = 100;
  log.fixes.pop_back();
  EXPECT_THAT(refusal(log), HasSubstr("no heights above take-off"));
  flight_.telemetry_height = "ellipsoid";
  log.fixes[0].absolute_height_m.reset();
  log.fixes[0].height_above_takeoff_m = 3;
  EXPECT_THAT(refusal(log), HasSubstr("no absolute heights"));
}

}  // namespace
}  // namespace tileflight::ingest::telemetry_positions_test

namespace tileflight::ingest::takeoff_height_test {
namespace {

using ::testing::HasSubstr;

const geometry::Geodetic kOrigin{47.0, 8.5, {400.0}};

/// A slope of 1 in 10 eastwards, at x = 0 5 m above the origin, with a roof of 1 m x 1 m 4 m above it at x = 10.
class TakeoffAnchor : public testing::Test {
 protected:
  void SetUp() override {
    std::ofstream(folder_ / "slope.obj") << "v -50 -50 0\nv 50 -50 10\nv 50 50 10\nv -50 50 0\nf 1 2 3 4\n"
                                         << "v 9.5 -0.5 10\nv 10.5 -0.5 10\nv 10.5 0.5 10\nv 9.5 0.5 10\nf 5 6 7 8\n";
    mesh_files::MeshSource source = mesh_files::read_mesh_source(folder_ / "slope.obj", {});
    tile_writer::MeshTilesetOptions options;
    options.T_ecef_local = geometry::LocalFrame(kOrigin).T_ecef_local();
    tile_writer::write_mesh_tileset(folder_ / "place", std::move(source.meshes), options);
    place::ExtractSettings settings;
    settings.source = (folder_ / "place").string();
    settings.load.origin = kOrigin;
    place::extract(settings, folder_ / "truth", false);
  }

  /// A log whose first position is `east_m`, `north_m` of the origin, `above_m` above take-off.
  flight_logs::Telemetry log_at(double east_m, double north_m, double above_m) const {
    const geometry::Geodetic at = geometry::LocalFrame(kOrigin).geodetic_from_local({east_m, north_m, 0});
    flight_logs::Telemetry log;
    log.fixes.resize(2);
    log.fixes[0].latitude_deg = log.fixes[1].latitude_deg = at.latitude_deg;
    log.fixes[0].longitude_deg = log.fixes[1].longitude_deg = at.longitude_deg;
    log.fixes[0].height_above_takeoff_m = above_m;
    log.fixes[1].height_above_takeoff_m = 30.0;
    log.fixes[1].time_s = 10;
    return log;
  }
  double height(const flight_logs::Telemetry& log) const {
    return estimate_takeoff_height(log, "log.srt", folder_ / "truth").m;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(TakeoffAnchor, IsTheSurfacesHeightWhereTheLogIsOnTheGround) {
  EXPECT_NEAR(height(log_at(0, 0, 0)), 405.0, 0.02);
  EXPECT_NEAR(height(log_at(20, -10, 0)), 407.0, 0.02);
  EXPECT_NEAR(height(log_at(20, -10, 1.5)), 405.5, 0.02) << "the zero lies 1.5 m below";
  EXPECT_NEAR(height(log_at(10, 0, 0)), 406.0, 0.02) << "what stands over one vertical does not count";
}

TEST_F(TakeoffAnchor, WhatDoesNotSayTheHeightIsRefused) {
  EXPECT_THAT(tests::refusal_of([&] { height(log_at(0, 0, 12)); }), HasSubstr("within 2 m"));
  EXPECT_THAT(tests::refusal_of([&] { height(log_at(500, 0, 0)); }), HasSubstr("outside the ground truth"));
}

}  // namespace
}  // namespace tileflight::ingest::takeoff_height_test
