// `render` of flights with weather: what is recorded, refused, and the same for any number of threads, processes and
// parts.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/render_command.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_city.h"
#include "tests/tiny_place.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/dataset.h"

namespace tileflight::weather_test {
namespace {

using testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyCity;
using tests::TinyPlace;

constexpr const char* kWeather = R"(weather:
  fog_visibility_m: 900
  scale_height_m: 80
  base_height_m: 100
  rain_mm_per_h: 40
  wetness: 0.5
  wind_m_s: [4, -1]
)";
constexpr const char* kDegrade =
    "exposure_time: 0.004\nexposure_samples: 3\nline_delay: 0.00005\nwhite_electrons: 4000\n";

class Weather : public testing::Test {
 protected:
  Weather() {
    TinyCity::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::camera_of_quarter_size());
    TinyPlace::write_file(folder_ / "degrade.yaml", kDegrade);
    write_flight(kWeather);
  }
  void write_flight(const std::string& weather) const {
    TinyPlace::write_file(folder_ / "flight.yaml", TinyCity::kFlight + weather);
  }
  std::vector<std::string> arguments(const std::string& out, const std::vector<std::string>& more) const {
    return tests::render_words(folder_.path(), out, more);
  }
  nlohmann::json render(const std::string& out, const std::vector<std::string>& more = {}) const {
    return tests::render_json(folder_.path(), out, more);
  }
  std::vector<imaging::Rgb8> picture(const std::string& out) const {
    return imaging::read_rgb(folder_ / out / "images" / "000003.png").pixels;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Weather, IsTheSameInPartsAndTasks) {
  const std::vector<std::string> more{"--outputs", "depth",     "--samples",
                                      "4",         "--degrade", (folder_ / "degrade.yaml").string()};
  const auto with = [&](std::vector<std::string> words) {
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  render("whole", with({"--memory", "1", "--threads", "1"}));
  EXPECT_GT(render("parts", with({"--memory", "0.0062", "--threads", "2"}))["parts"], 1);
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
  const ProgramResult tasks = run_tileflight(arguments("tasks", with({"--jobs", "2", "--no-snakemake"})));
  ASSERT_EQ(tasks.exit_code, 0) << tasks.err;
  tests::expect_same_files(folder_ / "whole", folder_ / "tasks");
}

TEST_F(Weather, IsRecordedAndChangesPicturesAlone) {
  render("wet", {"--png", "--outputs", "depth"});
  write_flight("");
  render("dry", {"--png", "--outputs", "depth"});
  write_flight("weather: {}\n");
  render("clear", {"--png", "--outputs", "depth"});
  EXPECT_NE(picture("wet"), picture("dry"));
  EXPECT_EQ(picture("clear"), picture("dry"));
  for (const char* file : {"depth/000003.exr", "groundtruth.txt"})
    EXPECT_EQ(tests::file_text(folder_ / "wet" / file), tests::file_text(folder_ / "dry" / file)) << file;
  EXPECT_THAT(
      tests::file_text(folder_ / "wet" / "dataset.yaml"),
      HasSubstr("fog_visibility_m: 900, scale_height_m: 80, base_height_m: 100, rain_mm_per_h: 40, wetness: 0.5, "
                "wind_east_m_s: 4, wind_north_m_s: -1"));
  EXPECT_THAT(tests::file_text(folder_ / "dry" / "dataset.yaml"), testing::Not(HasSubstr("weather")));
}

TEST_F(Weather, WhatIsWrongIsNamedInOneLine) {
  const auto refusal = [&](const std::string& weather) {
    write_flight("weather: " + weather + "\n");
    const ProgramResult result = run_tileflight(arguments("wrong", {}));
    EXPECT_EQ(result.exit_code, 1) << weather;
    EXPECT_EQ(std::ranges::count(result.err, '\n'), 1) << result.err;
    return result.err;
  };
  EXPECT_THAT(refusal("{fog_visibility: 100}"), HasSubstr("fog_visibility_m"));
  EXPECT_THAT(refusal("{fog_visibility_m: 0}"), HasSubstr("weather.fog_visibility_m"));
  EXPECT_THAT(refusal("{rain_mm_per_h: 1000}"), HasSubstr("300"));
  EXPECT_THAT(refusal("{wetness: .nan}"), HasSubstr("wetness"));
  EXPECT_THAT(refusal("{wind_m_s: [300, 0]}"), HasSubstr("100 m/s"));
  EXPECT_THAT(refusal("rain"), HasSubstr("weather"));
}

}  // namespace
}  // namespace tileflight::weather_test
