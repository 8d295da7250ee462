// `render` by ranges of frames: for a job of one's own, and as tasks of a workflow.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/tiny_place.h"

namespace tileflight::frame_tasks_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyPlace;

constexpr const char* kDegrade = R"(exposure_time: 0.002
auto_exposure: {target: 0.25, time_constant: 0.2}
white_electrons: 5000
)";

class FrameTasks : public ::testing::Test {
 protected:
  FrameTasks() {
    TinyPlace::write(folder_ / "place");
    TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::kCamera);
    TinyPlace::write_file(folder_ / "flight.yaml", "camera: camera.yaml\n" + TinyPlace::path_with_sensors(17));
    TinyPlace::write_file(folder_ / "degrade.yaml", kDegrade);
  }
  ProgramResult render(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words{"render",    (folder_ / "place").string(),
                                   "--flight",  (folder_ / "flight.yaml").string(),
                                   "--degrade", (folder_ / "degrade.yaml").string(),
                                   "--outputs", "depth,segmentation,flow",
                                   "--out",     (folder_ / out).string(),
                                   "--json"};
    words.insert(words.end(), more.begin(), more.end());
    return run_tileflight(words);
  }
  void expect_same(const std::string& other) const {
    tests::expect_same_files(folder_ / "alone", folder_ / other);
    for (const char* kind : {"frames", "tasks"}) EXPECT_FALSE(fs::exists(folder_ / ("." + other + "." + kind)));
  }

  tests::TemporaryFolder folder_;
};

TEST_F(FrameTasks, GiveTheSameFilesAsOneProcess) {
  const ProgramResult alone = render("alone", {});
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  for (const std::string range : {"10:17", "0:10"}) {
    const ProgramResult part = render("parts", {"--frames", range});
    ASSERT_EQ(part.exit_code, 0) << part.err;
    EXPECT_EQ(json::parse(part.out)["frames"], json::parse(part.out)["frames_rendered"]);
    EXPECT_FALSE(fs::exists(folder_ / "parts"));
  }
  EXPECT_EQ(json::parse(render("parts", {"--frames", "3:12"}).out)["frames_rendered"], 0);
  const ProgramResult finish = render("parts", {"--resume"});
  ASSERT_EQ(finish.exit_code, 0) << finish.err;
  EXPECT_EQ(json::parse(finish.out)["frames_taken_up"], 17);
  expect_same("parts");

  const ProgramResult tasks = render("tasks", {"--jobs", "2", "--threads", "2"});
  ASSERT_EQ(tasks.exit_code, 0) << tasks.err;
  EXPECT_EQ(json::parse(tasks.out)["frames"], 17);
  EXPECT_EQ(json::parse(tasks.out)["frames_taken_up"], 17);
  expect_same("tasks");
}

TEST_F(FrameTasks, GiveTheSameVideo) {
  TinyPlace::write_file(folder_ / "degrade.yaml", std::string(kDegrade) + "video_bitrate: 0.5\n");
  ASSERT_EQ(render("alone", {}).exit_code, 0);
  const ProgramResult tasks = render("tasks", {"--jobs", "2", "--no-snakemake"});
  ASSERT_EQ(tasks.exit_code, 0) << tasks.err;
  expect_same("tasks");
}

TEST_F(FrameTasks, BadRangesAreOneLine) {
  for (const std::string range : {"5:5", "7:3", "5", "a:b"}) {
    const ProgramResult result = render("out", {"--frames", range});
    EXPECT_EQ(result.exit_code, 2);
    EXPECT_THAT(result.err, HasSubstr("must be the first frame and the one after the last, as in 0:100"));
  }
  const ProgramResult beyond = render("out", {"--frames", "17:20"});
  EXPECT_EQ(beyond.exit_code, 1);
  EXPECT_THAT(beyond.err, HasSubstr("--frames: the flight has frames 0 to 16"));
  EXPECT_FALSE(fs::exists(folder_ / ".out.frames"));
}

TEST_F(FrameTasks, FramesOfOtherSettingsAreNotTakenUp) {
  const fs::path folder = (folder_ / ".data.frames");
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
  tests::expect_same_files(folder_ / "new", folder_ / "data");
  ASSERT_EQ(render("kept", {"--resume"}).exit_code, 0);
  tests::expect_same_files(folder_ / "new", folder_ / "kept");
  EXPECT_FALSE(fs::exists(folder_ / ".kept.frames"));
}

}  // namespace
}  // namespace tileflight::frame_tasks_test
