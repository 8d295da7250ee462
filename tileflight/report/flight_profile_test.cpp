#include "tileflight/report/flight_profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tileflight::report {
namespace {

FlightProfile level_flight(int frames) {
  FlightProfile profile;
  profile.title = "A flight";
  for (int i = 0; i < frames; ++i) {
    profile.along_m.push_back(2.0 * i);
    profile.time_s.push_back(0.5 * i);
    profile.up_m.push_back(30.0);
    profile.above_ground_m.push_back(20.0 + 5 * std::sin(0.3 * i));
    profile.clearance_m.push_back(12.0);
    profile.troubled.push_back(false);
  }
  return profile;
}

std::ptrdiff_t red_pixels(const FlightProfile& profile) {
  const imaging::RgbImage image = drawn(profile);
  return std::ranges::count(image.pixels, imaging::Rgb8{204, 23, 28});
}

TEST(FlightProfile, MarksTroubleInRedAndOnlyThat) {
  FlightProfile profile = level_flight(50);
  EXPECT_EQ(red_pixels(profile), 0);
  profile.troubled[20] = true;
  EXPECT_GT(red_pixels(profile), 30);
  EXPECT_EQ(drawn(profile).pixels, drawn(profile).pixels);
}

TEST(FlightProfile, IsDrawnOfWhateverIsKnown) {
  EXPECT_GT(drawn(level_flight(1)).width, 0);
  EXPECT_GT(drawn(FlightProfile{.title = "none",
                                .notes = {},
                                .along_m = {},
                                .time_s = {},
                                .up_m = {},
                                .above_ground_m = {},
                                .clearance_m = {},
                                .troubled = {}})
                .width,
            0);
  FlightProfile unknown = level_flight(30);
  for (std::size_t i = 0; i < 30; ++i) {
    if (i % 7 != 3) unknown.above_ground_m[i] = std::nan("");
    unknown.clearance_m[i] = std::nan("");
  }
  EXPECT_GT(drawn(unknown).width, 0);
  FlightProfile hovering = level_flight(10);
  std::fill(hovering.along_m.begin(), hovering.along_m.end(), 0.0);
  EXPECT_GT(drawn(hovering).width, 0);
}

}  // namespace
}  // namespace tileflight::report
