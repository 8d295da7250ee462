#include "tileflight/capture/sensors/lidar_pattern.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "tileflight/core/base/input_error.h"
#include "tileflight/capture/sensors/lidar.h"

namespace tileflight::sensors::lidar_pattern_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

double elevation_deg(const LidarBeam& beam) { return std::asin(beam.direction.z()) * 180.0 / M_PI; }
double azimuth_deg(const LidarBeam& beam) { return std::atan2(-beam.direction.y(), beam.direction.x()) * 180.0 / M_PI; }

void expect_sound(const LidarPattern& pattern, std::uint64_t scan) {
  const std::vector<LidarBeam> beams = generate_beams(pattern, scan);
  for (std::size_t i = 0; i < beams.size(); ++i) {
    ASSERT_NEAR(beams[i].direction.norm(), 1.0, 1e-12);
    ASSERT_GE(beams[i].time_s, i == 0 ? 0.0 : beams[i - 1].time_s);
    ASSERT_LT(beams[i].time_s, scan_period_s(pattern));
  }
}

double points_per_second(const std::string& preset) {
  const LidarPattern pattern = lidar_preset(preset).pattern;
  expect_sound(pattern, 0);
  expect_sound(pattern, 7);
  return static_cast<double>(generate_beams(pattern, 3).size()) / scan_period_s(pattern);
}

TEST(LidarPattern, PresetsFireAsOftenAsTheirDataSheetsSay) {
  EXPECT_NEAR(points_per_second("vlp-16"), 16 / 55.296e-6, 100.0);
  EXPECT_NEAR(points_per_second("os1-64"), 655360, 1.0);
  EXPECT_NEAR(points_per_second("hdl-64e"), 1.333e6, 1000.0);
  EXPECT_NEAR(points_per_second("livox-mid-40"), 1e5, 1.0);
  EXPECT_THAT([&] { lidar_preset("radar"); }, ThrowsMessage<InputError>(HasSubstr("lidar 'radar': is unknown")));
}

// VLP-16, table 9-1: laser 0 at -15 degrees, 1 at 1, 2 at -13; ring 0 is the lowest.
TEST(LidarPattern, ChannelsFireInTurnAndAreCountedFromBelow) {
  const std::vector<LidarBeam> beams = generate_beams(lidar_preset("vlp-16").pattern, 0);
  const double expected[] = {-15, 1, -13, 3};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(elevation_deg(beams[i]), expected[i], 1e-9);
    EXPECT_NEAR(beams[i].time_s, 2.304e-6 * static_cast<double>(i), 1e-12);
    EXPECT_EQ(beams[i].ring, (expected[i] + 15) / 2);
  }
  EXPECT_NEAR(beams[16].time_s, 0.1 / 1808, 1e-12);
  // A quarter of a turn after the start at the back it looks left (clockwise from above), after half of it forward.
  EXPECT_NEAR(azimuth_deg(beams[16 * 452]), -90.0, 1e-9);
  EXPECT_NEAR(azimuth_deg(beams[16 * 904]), 0.0, 1e-9);
}

TEST(LidarPattern, TheFieldOfViewCanBeCut) {
  SpinningPattern pattern{.columns = 360, .elevations_deg = {0.0}};
  pattern.azimuth_from_deg = -30;
  pattern.azimuth_to_deg = 60;
  const std::vector<LidarBeam> beams = generate_beams(pattern, 0);
  EXPECT_EQ(beams.size(), 91U);
  for (const LidarBeam& beam : beams) {
    EXPECT_GE(azimuth_deg(beam), -30 - 1e-9);
    EXPECT_LE(azimuth_deg(beam), 60 + 1e-9);
  }
}

TEST(LidarPattern, ARosetteFillsItsConeMoreAndMore) {
  const RosettePattern pattern;
  const auto cells_after = [&](int scans) {
    std::set<std::pair<int, int>> cells;
    for (int scan = 0; scan < scans; ++scan) {
      for (const LidarBeam& beam : generate_beams(pattern, scan)) {
        EXPECT_LE(std::acos(beam.direction.x()) * 180 / M_PI, 19.2 + 1e-9);
        cells.emplace(std::floor(beam.direction.y() * 150), std::floor(beam.direction.z() * 150));
      }
    }
    return static_cast<double>(cells.size());
  };
  const double all = M_PI * std::pow(150 * std::sin(19.2 * M_PI / 180), 2);
  EXPECT_LT(cells_after(1) / all, 0.9);
  EXPECT_GT(cells_after(10) / all, 0.98);
  EXPECT_GT(cells_after(10), 1.2 * cells_after(1));
}

TEST(LidarPattern, ARasterIsReadLikeAPage) {
  const RasterPattern pattern{
      .rate_hz = 5.0, .columns = 4, .rows = 2, .horizontal_fov_deg = 40, .vertical_fov_deg = 20};
  expect_sound(pattern, 0);
  const std::vector<LidarBeam> beams = generate_beams(pattern, 0);
  ASSERT_EQ(beams.size(), 8U);
  EXPECT_NEAR(azimuth_deg(beams[0]), -15.0, 1e-9);
  EXPECT_NEAR(elevation_deg(beams[0]), 5.0, 1e-9);
  EXPECT_NEAR(azimuth_deg(beams[7]), 15.0, 1e-9);
  EXPECT_NEAR(elevation_deg(beams[7]), -5.0, 1e-9);
}

TEST(LidarPattern, RefusesWhatCannotBe) {
  EXPECT_THAT([&] { check(LidarPattern(SpinningPattern{})); },
              ThrowsMessage<InputError>(HasSubstr("lidar columns: and channels must be 1 or more")));
  EXPECT_THAT([&] { check(LidarPattern(SpinningPattern{.elevations_deg = {91.0}})); },
              ThrowsMessage<InputError>(HasSubstr("lidar elevations: must lie between -90 and 90 degrees")));
  EXPECT_THAT(
      [&] {
        check(LidarPattern(SpinningPattern{.elevations_deg = {0, 1}, .channel_delay_s = 1.0}));
      },
      ThrowsMessage<InputError>(HasSubstr("lidar channel_delay: must be 0 or more")));
  EXPECT_THAT([&] { check(LidarPattern(RasterPattern{.rows = 0})); },
              ThrowsMessage<InputError>(HasSubstr("lidar rows: and columns must be 1 or more")));
  EXPECT_THAT([&] { check(LidarPattern(RasterPattern{.rate_hz = 0.0})); },
              ThrowsMessage<InputError>(HasSubstr("lidar rate: must lie between 0 and 1000 scans a second")));
  EXPECT_THAT([&] { check(LidarPattern(RosettePattern{.fov_deg = 200})); },
              ThrowsMessage<InputError>(HasSubstr("lidar fov: must lie between 0 and 180 degrees")));
}

}  // namespace
}  // namespace tileflight::sensors::lidar_pattern_test
