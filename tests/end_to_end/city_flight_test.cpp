// A flight across a place of several levels: groups of frames with their own tiles, rendered in parts, by several
// processes, and after one was killed.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

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

  /// Pictures of a quarter of the pixels; with kTilesOfWhole by the tiles, and so the memory, of the whole ones.
  void use_small_pictures() const {
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::camera_of_quarter_size());
  }
  static inline const std::vector<std::string> kTilesOfWhole{"--pixel-error", "0.5"};

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
  use_small_pictures();
  const std::vector<std::string> outputs{"--outputs", "depth,segmentation,flow,normals",  "--samples", "4",
                                         "--degrade", (folder_ / "degrade.yaml").string()};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), outputs.begin(), outputs.end());
    more.insert(more.end(), kTilesOfWhole.begin(), kTilesOfWhole.end());
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

/// Frames that are all near each other, some of them below the ground.
constexpr const char* kDive = R"(camera: camera.yaml
fps: 1
speed_m_s: 20
acceleration_m_s2: 40
waypoints:
  - {position: [-70, -60, 130], yaw_deg: 80, pitch_deg: -20}
  - {position: [0, -50, 92], yaw_deg: 80, pitch_deg: -10}
  - {position: [30, -55, 93], yaw_deg: 250, pitch_deg: 0}
  - {position: [80, -60, 130], yaw_deg: 60, pitch_deg: -20}
)";

TEST_F(CityFlight, TheGroundAroundACameraIsFoundByPartsOfTheTiles) {
  TinyPlace::write_file(folder_ / "flight.yaml", kDive);
  const std::vector<std::string> outputs{"--outputs", "depth,segmentation"};
  const auto with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> words = outputs;
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  const json whole = render("whole", with({"--memory", "1"}));
  EXPECT_EQ(whole["parts"], 1);
  EXPECT_THAT(whole["warnings"].dump(), HasSubstr("the camera is inside or under a surface"));
  EXPECT_THAT(whole["warnings"].dump(), HasSubstr("through a surface"));
  const auto expect_same = [&](const json& result, const std::string& out) {
    for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(result[key], whole[key]) << key;
    tests::expect_same_files(folder_ / "whole", folder_ / out);
  };
  const json apart = render("apart", with({"--memory", "0.005"}));
  EXPECT_EQ(apart["frames_divided"], 0) << "only both together do not fit: the image, and what surrounds the camera";
  EXPECT_GT(apart["parts"], 1);
  expect_same(apart, "apart");
  const json layers = render("layers", with({"--memory", "0.003"}));
  EXPECT_GT(layers["frames_divided"], 0);
  expect_same(layers, "layers");
#ifdef TILEFLIGHT_MPIRUN
  for (const int count : {2, 4}) {
    const std::string out = "by" + std::to_string(count);
    const ProgramResult result =
        tests::run_by_mpirun(count, arguments(out, with({"--deal", "tiles", "--memory", count == 2 ? "1" : "0.003"})));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json shared = json::parse(result.out);
    EXPECT_EQ(shared["dealt"], "tiles");
    expect_same(shared, out);
  }
#endif
}

TEST_F(CityFlight, TheGroundAroundACameraIsFoundByRegionsToo) {
  TinyPlace::write_file(folder_ / "flight.yaml", kDive);
  use_small_pictures();
  const json whole = render("whole", {"--memory", "1", "--samples", "4", "--pixel-error", "0.5"});
  const json regions = render("regions", {"--memory", "0.0035", "--samples", "4", "--pixel-error", "0.5"});
  EXPECT_GT(regions["frames_divided"], 0);
  EXPECT_EQ(regions["warnings"], whole["warnings"]);
  tests::expect_same_files(folder_ / "whole", folder_ / "regions");
}

class CityFlightInLayers : public CityFlight {
 protected:
  /// The flight with all that fits, in layers because little does, and by processes of which some frames fit in each.
  void expect_same_files() const {
    use_small_pictures();
    TinyPlace::write_file(folder_ / "degrade.yaml", R"(line_delay: 0.00002
vignetting: 0.3
auto_exposure: {target: 0.25, time_constant: 3}
)");
    const std::vector<std::string> outputs{"--outputs", "depth,segmentation,flow,normals", "--degrade",
                                           (folder_ / "degrade.yaml").string()};
    const auto with = [&](std::vector<std::string> more) {
      more.insert(more.end(), outputs.begin(), outputs.end());
      more.insert(more.end(), kTilesOfWhole.begin(), kTilesOfWhole.end());
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
    for (const std::string deal : {"frames", "tiles"}) {
      const ProgramResult shared = tests::run_by_mpirun(2, arguments(deal, with({"--memory", "0.01", "--deal", deal})));
      ASSERT_EQ(shared.exit_code, 0) << shared.err;
      tests::expect_same_files(folder_ / "whole", folder_ / deal);
    }
#endif
  }
};

TEST_F(CityFlightInLayers, FramesOfOneRayAPixel) { expect_same_files(); }

TEST_F(CityFlightInLayers, WhatDrivesAndWhatFalls) {
  TinyPlace::write_file(folder_ / "flight.yaml", std::string(TinyCity::kFlight) + R"(weather: {rain_mm_per_h: 30}
actors:
  - {name: t0, model: car, scale: 12, on_ground: false, speed_m_s: 40, path: [{at: [-430, -300, 103]}, {at: [570, -270, 103]}]}
  - {name: bus, model: van, scale: 9, on_ground: false, speed_m_s: 30, path: [{at: [350, -240, 104]}, {at: [300, 100, 104]}]}
  - {name: kite, model: sphere, scale: 25, on_ground: false, position: [0, -285, 110]}
  - {name: truck, model: van, scale: 6, speed_m_s: 25, path: [{at: [-400, -320]}, {at: [0, -280]}, {at: [520, -300]}]}
  - {name: Ann, model: person, scale: 20, path: [{at: [350, -220]}, {at: [260, 150, 101]}]}
)");
  expect_same_files();
  int visible = 0;
  const json coco = json::parse(tests::file_text(folder_ / "layers/coco.json"));
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
/// Effects of one ray a pixel, some of which look at neighbouring pixels, rows or frames.
constexpr const char* kOneRayDegrade = R"(line_delay: 0.00002
vignetting: 0.3
sharpening: 0.5
white_electrons: 5000
read_noise_electrons: 4
auto_exposure: {target: 0.25, time_constant: 3}
)";

TEST_F(CityFlight, ProcessesThatShareTheTilesChangeNoByte) {
  use_small_pictures();
  TinyPlace::write_file(folder_ / "degrade.yaml", kOneRayDegrade);
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), {"--outputs", "depth,range,normals,segmentation,flow,visibility,photometric", "--degrade",
                             (folder_ / "degrade.yaml").string()});
    more.insert(more.end(), kTilesOfWhole.begin(), kTilesOfWhole.end());
    return more;
  };
  const json alone = render("alone", with({"--memory", "1"}));
  EXPECT_EQ(alone["dealt"], nullptr);
  const auto expect_same = [&](int count, const std::string& out, const std::string& gigabytes) {
    const ProgramResult result =
        tests::run_by_mpirun(count, arguments(out, with({"--deal", "tiles", "--memory", gigabytes})));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json shared = json::parse(result.out);
    EXPECT_EQ(shared["dealt"], "tiles");
    for (const char* key : {"frames", "tiles", "complete", "warnings"}) EXPECT_EQ(shared[key], alone[key]) << key;
    tests::expect_same_files(folder_ / "alone", folder_ / out);
  };
  expect_same(2, "by2", "1");
  expect_same(4, "by4", "1");
  expect_same(3, "layers", "0.003");  // each process's tiles in several scenes, and few images at once
}

TEST_F(CityFlight, ARigOfProcessesThatShareTheTilesChangesNoByte) {
  std::string flight(TinyCity::kFlight);
  flight.replace(flight.find("camera: camera.yaml"), 19, R"(cameras:
  - {name: left, camera: camera.yaml, position: [0, 0.3, 0], yaw_deg: 20}
  - {name: down, camera: camera.yaml, pitch_deg: -90, fps: 0.25})");
  TinyPlace::write_file(folder_ / "flight.yaml", flight);
  TinyPlace::write_file(folder_ / "degrade.yaml", kOneRayDegrade);
  const std::vector<std::string> more{"--outputs", "depth,segmentation", "--degrade",
                                      (folder_ / "degrade.yaml").string()};
  EXPECT_EQ(render("alone", more)["cameras"], 2);
  std::vector<std::string> shared = more;
  shared.insert(shared.end(), {"--deal", "tiles"});
  const ProgramResult result = tests::run_by_mpirun(3, arguments("shared", shared));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  tests::expect_same_files(folder_ / "alone", folder_ / "shared");
}

TEST_F(CityFlight, ProcessesReadEachTileOnceIfTheyShareThem) {
  const auto tiles_read = [&](const std::string& deal) {
    const ProgramResult result = tests::run_by_mpirun(3, arguments(deal, {"--deal", deal, "--memory", "1"}));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    const json summary = json::parse(result.out);
    EXPECT_EQ(summary["dealt"], deal);
    return summary["tiles_read"].get<int>();
  };
  const json alone = render("alone", {"--memory", "1"});
  const int by_tiles = tiles_read("tiles"), by_frames = tiles_read("frames");
  EXPECT_LT(by_tiles, by_frames);
  // The tiles beside a camera are read by the process that checks its path, too.
  EXPECT_LT(by_tiles, alone["tiles_read"].get<int>() * 3 / 2);
  tests::expect_same_files(folder_ / "tiles", folder_ / "frames");
}

TEST_F(CityFlight, TilesAreNotSharedWherePixelsTakeSeveralRays) {
  const std::vector<std::string> more{"--samples", "4", "--deal"};
  const auto deal = [&](const std::string& how) {
    std::vector<std::string> words = more;
    words.push_back(how);
    return tests::run_by_mpirun(2, arguments(how, words));
  };
  const ProgramResult refused = deal("tiles"), automatic = deal("auto");
  EXPECT_NE(refused.exit_code, 0);
  EXPECT_THAT(refused.err, HasSubstr("tileflight: --deal tiles: a pixel takes several rays"));
  ASSERT_EQ(automatic.exit_code, 0) << automatic.err;
  EXPECT_EQ(json::parse(automatic.out)["dealt"], "frames");
}

TEST_F(CityFlight, AProcessOfThoseThatShareTheTilesDiesAndTheOthersFramesAreTakenUp) {
  const std::vector<std::string> more{"--outputs", "segmentation,depth", "--threads", "1"};
  std::vector<std::string> shared = more;
  shared.insert(shared.end(), {"--deal", "tiles", "--memory", "0.003"});  // few images at once
  render("whole", more);
  const fs::path kept = folder_ / ".data.frames";
  const auto finished = [&] {
    std::error_code error;
    std::size_t count = 0;
    for (fs::directory_iterator entry(kept / "frames", error), end; !error && entry != end; entry.increment(error))
      count += entry->path().extension() == ".json" ? 1 : 0;
    return count;
  };
  ProgramResult result;
  std::thread run([&] { result = tests::run_by_mpirun(2, arguments("data", shared)); });
  while (finished() < 4 && !fs::exists(folder_ / "data")) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  const auto victim = tests::process_of_rank(1, (folder_ / "data").string());
  EXPECT_TRUE(victim.has_value());
  if (victim) ::kill(*victim, SIGKILL);
  run.join();
  EXPECT_THAT(result.err, HasSubstr("rank 1 of 2 died; ")) << result.err;
  const std::size_t there = finished();
  ASSERT_GE(there, 4U);
  const ProgramResult rest = tests::run_by_mpirun(2, arguments("data", shared));
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(json::parse(rest.out)["frames_taken_up"], there);
  tests::expect_same_files(folder_ / "whole", folder_ / "data");
}

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
