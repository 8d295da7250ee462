#include "tileflight/core/drawing/flight_profile.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace tileflight::drawing::flight_profile_test {
namespace {

FlightProfile level_flight(int frames) {
  FlightProfile profile;
  profile.title = "A flight";
  for (int i = 0; i < frames; ++i) {
    profile.distance_flown_m.push_back(2.0 * i);
    profile.time_s.push_back(0.5 * i);
    profile.up_m.push_back(30.0);
    profile.above_ground_m.push_back(20.0 + 5 * std::sin(0.3 * i));
    profile.clearance_m.push_back(12.0);
    profile.in_collision.push_back(false);
  }
  return profile;
}

std::ptrdiff_t red_pixels(const FlightProfile& profile) {
  const imaging::RgbImage image = draw_to_image(profile);
  return std::ranges::count(image.pixels, imaging::Rgb8{204, 23, 28});
}

TEST(FlightProfile, MarksTroubleInRedAndOnlyThat) {
  FlightProfile profile = level_flight(50);
  EXPECT_EQ(red_pixels(profile), 0);
  profile.in_collision[20] = true;
  EXPECT_GT(red_pixels(profile), 30);
  EXPECT_EQ(draw_to_image(profile).pixels, draw_to_image(profile).pixels);
}

TEST(FlightProfile, IsDrawnOfWhateverIsKnown) {
  EXPECT_GT(draw_to_image(level_flight(1)).width, 0);
  EXPECT_GT(draw_to_image(FlightProfile{.title = "none",
                                        .notes = {},
                                        .distance_flown_m = {},
                                        .time_s = {},
                                        .up_m = {},
                                        .above_ground_m = {},
                                        .clearance_m = {},
                                        .in_collision = {}})
                .width,
            0);
  FlightProfile unknown = level_flight(30);
  for (std::size_t i = 0; i < 30; ++i) {
    if (i % 7 != 3) unknown.above_ground_m[i] = std::nan("");
    unknown.clearance_m[i] = std::nan("");
  }
  EXPECT_GT(draw_to_image(unknown).width, 0);
  FlightProfile hovering = level_flight(10);
  std::fill(hovering.distance_flown_m.begin(), hovering.distance_flown_m.end(), 0.0);
  EXPECT_GT(draw_to_image(hovering).width, 0);
}

}  // namespace
}  // namespace tileflight::drawing::flight_profile_test
