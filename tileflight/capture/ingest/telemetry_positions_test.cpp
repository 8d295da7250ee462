#include "tileflight/capture/ingest/telemetry_positions.h"

#include <gmock/gmock.h>

#include "tests/refusal.h"

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
  flight_.telemetry_height = "ellipsoid";
  EXPECT_EQ(fixes(flight_logs::HeightDatum::kMeanSeaLevel).front().position.height.m, 120);
  EXPECT_THAT(warnings_, IsEmpty());
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
  EXPECT_THAT(refusal(log), HasSubstr("no absolute heights"));
}

}  // namespace
}  // namespace tileflight::ingest::telemetry_positions_test
