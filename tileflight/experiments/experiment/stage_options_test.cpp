#include "tileflight/experiments/experiment/stage_options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::experiment::stage_options_test {
namespace {

using testing::HasSubstr;

render::ImageFormation formation(const std::string& text) {
  StrictSection section(base::DocumentValue(YAML::Load(text)), "degrade.yaml", "");
  return render::read_image_formation(section);
}

std::string fault(const std::string& text) {
  try {
    formation(text);
  } catch (const InputError& error) {
    return error.what();
  }
  return "no error";
}

TEST(StageOptions, LightIsBakedUnlessAskedFor) {
  EXPECT_FALSE(formation("{}").light);
  EXPECT_FALSE(formation("light: {model: baked, time: 2024-03-20T17:00:00Z}").light);
  EXPECT_TRUE(is_ideal(formation("light: {model: baked}")));
  EXPECT_FALSE(is_ideal(formation("light: {model: sun-and-sky}")));
  EXPECT_EQ(formation("light: {turbidity: 4}").light->utc_s, std::nullopt);  // the renderer may know the time
}

TEST(StageOptions, LightHasAllItsKeys) {
  const render::DaylightOptions light = *formation(
                                             "light:\n  time: 2024-03-20T12:00:00-05:00\n  turbidity: 4.5\n"
                                             "  ground_albedo: 0.1\n  exposure: -1.5\n  white_balance: daylight\n")
                                             .light;
  EXPECT_EQ(light.utc_s, base::parse_iso_time_s("2024-03-20T17:00:00Z"));
  EXPECT_EQ(light.turbidity, 4.5);
  EXPECT_EQ(light.ground_albedo, 0.1);
  EXPECT_EQ(light.exposure_stops, -1.5);
  EXPECT_EQ(light.white_balance, render::WhiteBalance::kDaylight);
}

TEST(StageOptions, LightThatCannotBeIsRefused) {
  EXPECT_THAT(fault("light: {time: 2023-02-29T12:00:00Z}"), HasSubstr("valid date and time"));
  EXPECT_THAT(fault("light: {time: 2024-03-20}"), HasSubstr("time"));
  EXPECT_THAT(fault("light: {time: noon}"), HasSubstr("time"));
  EXPECT_THAT(fault("light: {turbidity: 1}"), HasSubstr("turbidity"));
  EXPECT_THAT(fault("light: {turbidty: 3}"), HasSubstr("turbidity"));
  EXPECT_THAT(fault("light: {model: moon}"), HasSubstr("sun-and-sky"));
  EXPECT_THAT(fault("light: {white_balance: auto}"), HasSubstr("daylight"));
}

TEST(StageOptions, HazeHasAColour) {
  EXPECT_FALSE(formation("haze_visibility: 500").haze_color);
  EXPECT_EQ(formation("haze_color: [200, 190.4, 0]").haze_color, (imaging::Rgb8{200, 190, 0}));
  EXPECT_THAT(fault("haze_color: [200, 190, 256]"), HasSubstr("0 to 255"));
  EXPECT_THAT(fault("haze_color: [200, 190]"), HasSubstr("haze_color"));
}

}  // namespace
}  // namespace tileflight::experiment::stage_options_test
