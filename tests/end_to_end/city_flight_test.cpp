// A flight across a place of several levels: groups of frames with their own tiles, rendered in parts, in tasks, and
// after a process was killed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/background_program.h"
#include "tests/render_command.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_city.h"

namespace tileflight::city_flight_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyCity;
using tests::TinyPlace;

constexpr const char* kSensors = R"(sensors:
  imu: {rate_hz: 20}
  range_finder: {rate_hz: 1}
  lidar: {pattern: raster, columns: 12, rows: 6, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 0.5}
)";

constexpr const char* kDegrade = R"(exposure_time: 0.002
exposure_samples: 3
auto_exposure: {target: 0.25, time_constant: 3}
)";

class CityFlight : public testing::Test {
 protected:
  CityFlight() {
    TinyCity::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", TinyCity::kFlight);
    TinyPlace::write_file(folder_ / "degrade.yaml", kDegrade);
  }

  std::vector<std::string> arguments(const std::string& out, const std::vector<std::string>& more) const {
    return tests::render_words(folder_.path(), out, more);
  }
  json render(const std::string& out, const std::vector<std::string>& more) const {
    return tests::render_json(folder_.path(), out, more);
  }

  tests::TemporaryFolder folder_;
};

TEST_F(CityFlight, MemoryChangesNoByte) {
  const std::vector<std::string> outputs{"--outputs", "depth,segmentation,flow", "--degrade",
                                         (folder_ / "degrade.yaml").string()};
  const auto with_memory = [&](const std::string& gigabytes) {
    std::vector<std::string> more = outputs;
    more.insert(more.end(), {"--memory", gigabytes});
    return more;
  };
  // A tile takes 0.14 MB while it is rendered; a frame needs up to 39.
  const json whole = render("whole", with_memory("1")), parts = render("parts", with_memory("0.0062"));
  EXPECT_GE(whole["parts"], 7);
  EXPECT_GT(parts["parts"], whole["parts"]);
  for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(parts[key], whole[key]) << key;
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
}

TEST_F(CityFlight, ThreadsAndOtherSensorsChangeNothingInParts) {
  TinyPlace::write_file(folder_ / "flight.yaml", std::string(TinyCity::kFlight) + kSensors);
  render("whole", {"--memory", "1", "--threads", "1"});
  render("parts", {"--memory", "0.0095", "--threads", "2"});
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
}

TEST_F(CityFlight, FarTilesAreCoarseInEachGroup) {
  const json crossing = render("crossing", {});
  // A flight of the same camera around the middle, which needs the finest tiles there and coarser ones far away.
  TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 0.5
speed_m_s: 40
acceleration_m_s2: 40
waypoints:
  - {position: [-20, 0, 160], yaw_deg: 90, pitch_deg: -40}
  - {position: [20, 0, 160], yaw_deg: 90, pitch_deg: -40}
)");
  const json middle = render("middle", {});
  EXPECT_EQ(middle["parts"], 1);
  EXPECT_LT(crossing["triangles"], 64 * 512) << "no scene holds all of the finest level";
  EXPECT_GT(crossing["tiles"], middle["tiles"]);
}

TEST_F(CityFlight, ThatGoesBelowTheGroundIsToldSoInPartsToo) {
  TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 1
speed_m_s: 20
acceleration_m_s2: 40
waypoints:
  - {position: [-70, -60, 130], yaw_deg: 80, pitch_deg: -20}
  - {position: [0, -50, 92], yaw_deg: 80, pitch_deg: -10}
  - {position: [30, -55, 93], yaw_deg: 250, pitch_deg: 0}
  - {position: [80, -60, 130], yaw_deg: 60, pitch_deg: -20}
)");
  const json whole = render("whole", {"--outputs", "depth,segmentation", "--memory", "1"});
  EXPECT_EQ(whole["parts"], 1);
  EXPECT_THAT(whole["warnings"].dump(), HasSubstr("the camera is inside or under a surface"));
  EXPECT_THAT(whole["warnings"].dump(), HasSubstr("through a surface"));
  const json parts = render("parts", {"--outputs", "depth,segmentation", "--memory", "0.007"});
  EXPECT_GT(parts["parts"], 1);
  for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(parts[key], whole[key]) << key;
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
}

TEST_F(CityFlight, WhatDrivesAndWhatFallsIsTheSameInPartsAndTasks) {
  TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::camera_of_quarter_size());
  TinyPlace::write_file(folder_ / "degrade.yaml", R"(line_delay: 0.00002
vignetting: 0.3
auto_exposure: {target: 0.25, time_constant: 3}
)");
  TinyPlace::write_file(folder_ / "flight.yaml", std::string(TinyCity::kFlight) + R"(weather: {rain_mm_per_h: 30}
actors:
  - {name: t0, model: car, scale: 12, on_ground: false, speed_m_s: 40, path: [{at: [-430, -300, 103]}, {at: [570, -270, 103]}]}
  - {name: bus, model: van, scale: 9, on_ground: false, speed_m_s: 30, path: [{at: [350, -240, 104]}, {at: [300, 100, 104]}]}
  - {name: kite, model: sphere, scale: 25, on_ground: false, position: [0, -285, 110]}
  - {name: truck, model: van, scale: 6, speed_m_s: 25, path: [{at: [-400, -320]}, {at: [0, -280]}, {at: [520, -300]}]}
  - {name: Ann, model: person, scale: 20, path: [{at: [350, -220]}, {at: [260, 150, 101]}]}
)");
  const auto with = [&](std::vector<std::string> more) {  // 0.5: by the tiles, and so the memory, of whole pictures
    more.insert(more.end(), {"--outputs", "depth,segmentation,flow,normals", "--degrade",
                             (folder_ / "degrade.yaml").string(), "--pixel-error", "0.5"});
    return more;
  };
  const json whole = render("whole", with({"--memory", "1"}));
  const json parts = render("parts", with({"--memory", "0.0062", "--threads", "1"}));
  EXPECT_GT(parts["parts"], whole["parts"]);
  for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(parts[key], whole[key]) << key;
  tests::expect_same_files(folder_ / "whole", folder_ / "parts");
  const ProgramResult tasks = run_tileflight(arguments("tasks", with({"--jobs", "2", "--no-snakemake"})));
  ASSERT_EQ(tasks.exit_code, 0) << tasks.err;
  tests::expect_same_files(folder_ / "whole", folder_ / "tasks");
  int visible = 0;
  const json coco = json::parse(tests::file_text(folder_ / "parts/coco.json"));
  for (const json& annotation : coco["annotations"]) visible += annotation["area"].get<int>() > 4 ? 1 : 0;
  EXPECT_GT(visible, 5);
}

TEST_F(CityFlight, APreviewShowsCoarserTilesWhereThoseOfAFrameDoNotFit) {
  const auto preview = [&](const std::string& out, const std::string& gigabytes) {
    std::vector<std::string> words = arguments(out, {"--memory", gigabytes});
    words[0] = "preview";
    const ProgramResult result = run_tileflight(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result.exit_code == 0 ? json::parse(result.out) : json();
  };
  const json whole = preview("whole", "1"), small = preview("small", "0.004");
  ASSERT_EQ(small["pictures"].size(), 3U);
  double coarsest_px = 1.0;
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(whole["pictures"][k]["pixel_error"], 1.0);
    EXPECT_LE(small["pictures"][k]["tiles"], whole["pictures"][k]["tiles"]);
    coarsest_px = std::max(coarsest_px, small["pictures"][k]["pixel_error"].get<double>());
  }
  EXPECT_GT(coarsest_px, 1.0);
  EXPECT_EQ(small["cost"]["tiles"], whole["cost"]["tiles"]) << "what render will read";
  EXPECT_THAT(small["warnings"].dump(), HasSubstr("coarser tiles, of up to"));
  EXPECT_THAT(whole["warnings"].dump(), testing::Not(HasSubstr("coarser tiles")));
}

TEST_F(CityFlight, AFrameThatDoesNotFitIsRefusedWithWhatWould) {
  const ProgramResult refused = run_tileflight(arguments("refused", {"--memory", "0.004"}));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_EQ(tests::line_count(refused.err), 1) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("more than 0.004 GB of memory: raise the limit (--memory "));
  EXPECT_FALSE(fs::exists(folder_ / "refused"));
  const auto number_after = [&](const std::string& word) {
    const std::size_t at = refused.err.find(word);
    EXPECT_NE(at, std::string::npos) << refused.err;
    return refused.err.substr(at + word.size(), refused.err.find(')', at) - at - word.size());
  };
  EXPECT_TRUE(render("more", {"--memory", number_after("(--memory ")})["complete"]);
  EXPECT_TRUE(render("coarser", {"--memory", "0.004", "--pixel-error", number_after("(--pixel-error ")})["complete"]);
}

TEST_F(CityFlight, WhatAKilledRenderLeftIsTakenUp) {
  const std::vector<std::string> more{"--memory",  "0.0062",
                                      "--outputs", "segmentation",
                                      "--degrade", (folder_ / "degrade.yaml").string(),
                                      "--samples", "4",
                                      "--threads", "1"};
  render("whole", more);
  std::vector<std::string> resumed = more;
  resumed.emplace_back("--resume");
  const fs::path frames = folder_ / ".killed.frames/frames";
  const auto finished = [&] {
    std::error_code error;
    std::size_t count = 0;
    for (fs::directory_iterator entry(frames, error), end; !error && entry != end; entry.increment(error)) {
      if (entry->path().extension() == ".json") ++count;  // another is about to be one
    }
    return count;
  };
  {
    tests::BackgroundProgram program(arguments("killed", resumed), folder_ / "log");
    while (finished() < 5 && program.runs()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }  // killed
  ASSERT_GE(finished(), 5U);
  ASSERT_FALSE(fs::exists(folder_ / "killed"));
  EXPECT_GE(render("killed", resumed)["frames_taken_up"], 5);
  tests::expect_same_files(folder_ / "whole", folder_ / "killed");
}

}  // namespace
}  // namespace tileflight::city_flight_test
