// `mpirun -n N tileflight render`: processes that share a flight's frames out among them, and one that dies.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/mpirun.h"
#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_place.h"

namespace tileflight::ranks_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::expect_same_files;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

#ifdef TILEFLIGHT_MPIRUN
using tests::process_of_rank;
using tests::run_by_mpirun;

constexpr const char* kFlight = R"(camera: camera.yaml
fps: 8
speed_m_s: 8
max_frames: 11
waypoints:
  - {position: [-10, -18, 112], yaw_deg: 20, pitch_deg: -30}
  - {position: [10, -15, 113], yaw_deg: 30, pitch_deg: -35}
sensors:
  imu: {rate_hz: 50}
  range_finder: {rate_hz: 10}
  lidar: {pattern: raster, columns: 20, rows: 10, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 8}
)";

constexpr const char* kDegrade = R"(exposure_time: 0.002
exposure_samples: 3
line_delay: 0.00005
vignetting: 0.4
auto_exposure: {target: 0.25, time_constant: 0.2}
white_electrons: 5000
read_noise_electrons: 4
)";

class Ranks : public ::testing::Test {
 protected:
  Ranks() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", kFlight);
    TinyPlace::write_file(folder_ / "degrade.yaml", kDegrade);
  }

  std::vector<std::string> call(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words{
        "render", (folder_ / "place").string(), "--flight", (folder_ / "flight.yaml").string(),
        "--out",  (folder_ / out).string(),     "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  /// With outputs and effects of every kind.
  static std::vector<std::string> everything(const fs::path& degrade) {
    return {"--outputs", "depth,range,normals,segmentation,infrared,flow,visibility,photometric", "--degrade",
            degrade.string()};
  }
  ProgramResult render(const std::string& out, const std::vector<std::string>& more) const {
    return run_tileflight(call(out, more));
  }
  ProgramResult mpirun(int processes, const std::string& out, const std::vector<std::string>& more) const {
    return run_by_mpirun(processes, call(out, more));
  }
  fs::path kept(const std::string& out) const { return folder_ / ("." + out + ".frames"); }

  tests::TemporaryFolder folder_;
};

TEST_F(Ranks, GiveTheSameFilesAsOneProcess) {
  const std::vector<std::string> more = everything(folder_ / "degrade.yaml");
  const ProgramResult alone = render("alone", more);
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  EXPECT_EQ(json::parse(alone.out)["ranks"], 1);
  for (const int count : {2, 3}) {
    const std::string out = "by" + std::to_string(count);
    const ProgramResult result = mpirun(count, out, more);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const json summary = json::parse(result.out);
    EXPECT_EQ(summary["ranks"], count);
    EXPECT_EQ(summary["frames"], 11);
    EXPECT_EQ(summary["warnings"], json::parse(alone.out)["warnings"]);
    expect_same_files(folder_ / "alone", folder_ / out);
    EXPECT_FALSE(fs::exists(kept(out)));
  }
}

TEST_F(Ranks, GiveTheSameFilesThroughAVideo) {
  TinyPlace::write_file(folder_ / "video.yaml", std::string(kDegrade) + "video_bitrate: 0.5\n");
  const std::vector<std::string> more{"--degrade", (folder_ / "video.yaml").string(), "--png"};
  ASSERT_EQ(render("alone", more).exit_code, 0);
  const ProgramResult result = mpirun(2, "two", more);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(fs::exists(folder_ / "two/video.mp4"));
  expect_same_files(folder_ / "alone", folder_ / "two");
}

// As coverage_test has it: what all pictures look at does not fit, what each of them looks at does.
TEST_F(Ranks, GiveTheSameFilesInParts) {
  TinyPlace::write_file(folder_ / "camera.yaml",
                        "cam0: {camera_model: pinhole, intrinsics: [600, 600, 159.5, 119.5], distortion_model: radtan, "
                        "distortion_coeffs: [0, 0, 0, 0], resolution: [320, 240]}\n");
  TinyPlace::write_file(folder_ / "flight.yaml", R"(camera: camera.yaml
fps: 2
speed_m_s: 10
waypoints:
  - {position: [-25, -20, 112], yaw_deg: 0, pitch_deg: -90}
  - {position: [25, -20, 112], yaw_deg: 0, pitch_deg: -90}
  - {position: [25, 20, 112], yaw_deg: 0, pitch_deg: -90}
)");
  TinyPlace::write_file(folder_ / "degrade.yaml", "auto_exposure: {target: 0.25, time_constant: 0.4}\n");
  std::vector<std::string> more{"--outputs", "segmentation", "--degrade", (folder_ / "degrade.yaml").string()};
  ASSERT_EQ(render("whole", more).exit_code, 0);
  more.insert(more.end(), {"--memory", "0.0019"});
  const ProgramResult result = mpirun(2, "parts", more);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GE(json::parse(result.out)["parts"], 2);
  expect_same_files(folder_ / "whole", folder_ / "parts");
}

TEST_F(Ranks, FailWithOneLine) {
  const ProgramResult result = mpirun(2, "bad", {"--outputs", "depth", "--center-local", "900,0,0", "--size", "9,9,9"});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_FALSE(fs::exists(folder_ / "bad"));
  std::istringstream lines(result.err);
  int ours = 0;
  for (std::string line; std::getline(lines, line);) ours += line.starts_with("tileflight: ") ? 1 : 0;
  EXPECT_EQ(ours, 1) << result.err;
}

TEST_F(Ranks, AreRefusedByACommandThatDoesNotShareItsWork) {
  const ProgramResult result = run_by_mpirun(3, {"inspect", (folder_ / "place").string()});
  EXPECT_NE(result.exit_code, 0);
  EXPECT_THAT(result.err,
              testing::HasSubstr("tileflight: mpirun: only `render` and `extract --block` share their work"));
  EXPECT_THAT(result.err, testing::Not(testing::HasSubstr("place")));  // nobody looked
}

std::size_t frames_in(const fs::path& folder) {
  std::error_code error;
  std::size_t count = 0;
  for (fs::directory_iterator entry(folder / "frames", error), end; !error && entry != end; entry.increment(error)) {
    count += entry->path().extension() == ".json" ? 1 : 0;
  }
  return count;
}

TEST_F(Ranks, OneThatDiesIsNamedAndWhatIsThereIsTakenUp) {
  std::string flight(kFlight);
  flight.replace(flight.find("fps: 8"), 6, "fps: 30").replace(flight.find("max_frames: 11"), 14, "max_frames: 30");
  TinyPlace::write_file(folder_ / "flight.yaml", flight);
  const std::vector<std::string> more{"--samples", "4", "--outputs", "segmentation,depth", "--threads", "1"};
  const auto stop_midway = [&](const std::string& out) {
    ProgramResult result;
    std::thread run([&] { result = mpirun(2, out, more); });
    while (frames_in(kept(out)) < 4 && !fs::exists(folder_ / out))
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const auto victim = process_of_rank(1, (folder_ / out).string());
    EXPECT_TRUE(victim.has_value());
    if (victim) ::kill(*victim, SIGKILL);
    run.join();
    EXPECT_NE(result.exit_code, 0);
    EXPECT_FALSE(fs::exists(folder_ / out));
    EXPECT_THAT(result.err, HasSubstr("rank 1 of 2 died; ")) << result.err;
    EXPECT_THAT(result.err, HasSubstr(" of 30 frames are kept in " + kept(out).string() + ", missing: "));
    EXPECT_THAT(result.err, HasSubstr("run the same command again to render the missing frames"));
    return frames_in(kept(out));
  };
  const std::size_t there = stop_midway("data");
  ASSERT_GE(there, 4U);
  ASSERT_LT(there, 30U);
  const ProgramResult rest = render("data", more);  // by one process, which needs not be told
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_EQ(json::parse(rest.out)["frames_taken_up"], there);
  EXPECT_THAT(rest.out, HasSubstr(std::to_string(there) + " of 30 frames were reused from an earlier render"));
  EXPECT_FALSE(fs::exists(kept("data")));
  const ProgramResult other = render("other", more);
  expect_same_files(folder_ / "other", folder_ / "data");
  EXPECT_EQ(json::parse(other.out)["frames_taken_up"], 0);
}

TEST_F(Ranks, FramesOfOtherSettingsAreNotTakenUp) {
  const fs::path folder = kept("data");
  fs::create_directories(folder / "frames");
  fs::create_directories(folder / "dataset/images");
  TinyPlace::write_file(folder / "inputs.json", R"({"program": "another"})");
  TinyPlace::write_file(folder / "dataset/images/000099.jpg", "of another flight");
  const ProgramResult result = render("data", {});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out,
              HasSubstr("frames of an earlier render are not reused, because these inputs differ: path and camera, "
                        "program, seed, settings, source"));
  ASSERT_EQ(render("new", {}).exit_code, 0);
  expect_same_files(folder_ / "new", folder_ / "data");
  ASSERT_EQ(render("kept", {"--resume"}).exit_code, 0);
  expect_same_files(folder_ / "new", folder_ / "kept");
  EXPECT_FALSE(fs::exists(kept("kept")));
}
#else
TEST(Ranks, AreRefusedByABuildWithoutMpi) {
  const ProgramResult result =
      run_tileflight({"render", "place", "--flight", "flight.yaml", "--out", "data"}, "OMPI_COMM_WORLD_SIZE=2");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
  EXPECT_THAT(result.err, HasSubstr("this tileflight was built without MPI"));
}
#endif

}  // namespace
}  // namespace tileflight::ranks_test
