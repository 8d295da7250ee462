// A flight across a place of several levels: groups of frames with their own tiles, rendered in parts, by several
// processes, and after one was killed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/background_program.h"
#include "tests/mpirun.h"
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

TEST_F(CityFlight, AFrameLargerThanMemoryIsRenderedInRegions) {
  const std::vector<std::string> outputs{"--outputs", "depth,segmentation,flow,normals",  "--samples", "4",
                                         "--degrade", (folder_ / "degrade.yaml").string()};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), outputs.begin(), outputs.end());
    return more;
  };
  const json whole = render("whole", with({"--memory", "1"}));
  EXPECT_EQ(whole["frames_divided"], 0);
  const json regions = render("regions", with({"--memory", "0.005"}));
  EXPECT_GT(regions["frames_divided"], 2);
  EXPECT_LT(regions["frames_divided"], regions["frames"]) << "some frames fit";
  for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(regions[key], whole[key]) << key;
  tests::expect_same_files(folder_ / "whole", folder_ / "regions");
#ifdef TILEFLIGHT_MPIRUN
  const ProgramResult shared = tests::run_by_mpirun(2, arguments("shared", with({"--memory", "0.01"})));
  ASSERT_EQ(shared.exit_code, 0) << shared.err;
  tests::expect_same_files(folder_ / "whole", folder_ / "shared");
#endif
}

TEST_F(CityFlight, FramesOfOneRayAPixelAreRenderedInLayers) {
  TinyPlace::write_file(folder_ / "degrade.yaml", R"(line_delay: 0.00002
vignetting: 0.3
auto_exposure: {target: 0.25, time_constant: 3}
)");
  const std::vector<std::string> outputs{"--outputs", "depth,segmentation,flow,normals", "--degrade",
                                         (folder_ / "degrade.yaml").string()};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), outputs.begin(), outputs.end());
    return more;
  };
  const json whole = render("whole", with({"--memory", "1"}));
  EXPECT_EQ(whole["frames_divided"], 0);
  const json layers = render("layers", with({"--memory", "0.005", "--threads", "1"}));
  EXPECT_GT(layers["frames_divided"], 2);
  EXPECT_LT(layers["frames_divided"], layers["frames"]) << "some frames fit";
  for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(layers[key], whole[key]) << key;
  tests::expect_same_files(folder_ / "whole", folder_ / "layers");
#ifdef TILEFLIGHT_MPIRUN
  const ProgramResult shared = tests::run_by_mpirun(2, arguments("shared", with({"--memory", "0.01"})));
  ASSERT_EQ(shared.exit_code, 0) << shared.err;
  tests::expect_same_files(folder_ / "whole", folder_ / "shared");
#endif
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
  // A lidar looks all around, so that regions would need all tiles.
  TinyPlace::write_file(folder_ / "flight.yaml", std::string(TinyCity::kFlight) + kSensors);
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

#ifdef TILEFLIGHT_MPIRUN
TEST_F(CityFlight, ProcessesChangeNoByte) {
  TinyPlace::write_file(folder_ / "flight.yaml", std::string(TinyCity::kFlight) + kSensors);
  const std::vector<std::string> more{"--outputs", "segmentation", "--degrade", (folder_ / "degrade.yaml").string(),
                                      "--memory",  "0.0095"};
  render("alone", more);
  for (const int count : {2, 3, 4}) {
    const std::string out = "by" + std::to_string(count);
    const ProgramResult result = tests::run_by_mpirun(count, arguments(out, more));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    tests::expect_same_files(folder_ / "alone", folder_ / out);
  }
}
#endif

}  // namespace
}  // namespace tileflight::city_flight_test
