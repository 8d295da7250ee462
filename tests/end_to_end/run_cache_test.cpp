// `run` does again what its inputs ask for and nothing else: by content, not by times; also after a kill.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <set>
#include <thread>

#include "tests/background_program.h"
#include "tests/run_program.h"
#include "tests/tiny_experiments.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::run_cache_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsSupersetOf;
using ::testing::Not;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyExperiments;
using tests::TinyPlace;

/// A program that answers with the odometry of an earlier run.
constexpr const char* kScript = R"(#!/bin/sh
set -e
cp "$3"/trajectory.txt "$3"/map.ply "$2"
)";

/// The stages that a `run` did, as it says.
std::set<std::string> stages_in(const std::string& progress) {
  std::istringstream lines(progress);
  std::set<std::string> done;
  for (std::string line; std::getline(lines, line);) {
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos && line.find("unchanged, skipped") == std::string::npos)
      done.insert(line.substr(0, colon));
  }
  return done;
}

class RunCache : public ::testing::Test {
 protected:
  /// Begins with the inputs and their finished run in "out".
  RunCache() { TinyExperiments::one_flight().copy_to(folder_.path()); }

  void write(const std::string& name, const std::string& text) const { TinyPlace::write_file(folder_ / name, text); }
  std::vector<std::string> call(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words{"run", (folder_ / "experiment.yaml").string(), "--out", (folder_ / out).string()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  ProgramResult run(const std::string& out, const std::vector<std::string>& more = {}) const {
    const ProgramResult result = run_tileflight(call(out, more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return result;
  }
  std::set<std::string> stages_done(const std::string& out) const { return stages_in(run(out).err); }

  tests::TemporaryFolder folder_;
};

void touch(const fs::path& file) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(5));
}

TEST_F(RunCache, TouchedFilesAndOtherWaysToWriteTheSameChangeNothing) {
  EXPECT_THAT(stages_in(file_text(folder_ / "progress.txt")),
              IsSupersetOf({"truth", "simulated/dataset", "simulated/odometry", "report"}));
  EXPECT_THAT(stages_done("out"), testing::ElementsAre("report")) << "copied: it names the files";
  EXPECT_THAT(stages_done("out"), testing::IsEmpty());
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "place")) touch(entry.path());
  for (const char* name : {"camera.yaml", "flight.yaml", "sensors.yaml", "experiment.yaml"}) touch(folder_ / name);
  EXPECT_THAT(stages_done("out"), testing::IsEmpty()) << "touched";

  write("flight.yaml", "# what is flown\n" + file_text(folder_ / "flight.yaml") + "# the end\n");
  write("camera.yaml",
        "cam0: {resolution: [320, 240], distortion_coeffs: [0, 0, 0, 0], distortion_model: 'equidistant',\n"
        "  intrinsics: [152, 152, 159.50, 119.5], camera_model: \"pinhole\"}  # the same lens\n");
  write("sensors.yaml", "barometer:\n  rate_hz: 10.0\n");
  write("experiment.yaml",
        "simulated: {render: {flight: 'flight.yaml'}}   # first\n"
        "alignment:\n  method: point-to-mesh\n  start: 'true-poses'\nplace:\n"
        "  size: [80.0, 80, 20]\n  center_local:\n  - 0\n  - 0.0\n  - 100\n"
        "  source: place/tileset.json\nname: tiny\n");
  EXPECT_THAT(stages_done("out"), testing::ElementsAre("report")) << "written differently: it holds the files' hashes";

  // A folder of results beside the tiles is none of them.
  TinyPlace::write_file(folder_ / "place/.DS_Store", "x");
  fs::copy(folder_ / "out", folder_ / "place/out", fs::copy_options::recursive);
  run("place/out");
  EXPECT_THAT(stages_done("place/out"), testing::IsEmpty());
  EXPECT_THAT(stages_done("out"), testing::IsEmpty());
}

TEST_F(RunCache, WhatChangesIsDoneAgainWithWhatComesOfIt) {
  std::string flight = file_text(folder_ / "flight.yaml");
  write("flight.yaml", flight.replace(flight.find("fps: 10"), 7, "fps: 11"));
  EXPECT_EQ(stages_done("out").count("truth"), 0U);
  write("sensors.yaml", "barometer: {rate_hz: 20}\n");
  EXPECT_THAT(stages_done("out"), IsSupersetOf({"simulated/dataset", "simulated/evaluation"}));

  // A tile of other bytes, but of the same size and time.
  std::string tile = file_text(folder_ / "place/0.glb");
  const auto time = fs::last_write_time(folder_ / "place/0.glb");
  char& colour = tile[tile.size() * 36 / 100];
  colour = static_cast<char>(colour ^ 1);
  TinyPlace::write_file(folder_ / "place/0.glb", tile);
  fs::last_write_time(folder_ / "place/0.glb", time);
  EXPECT_THAT(stages_done("out"), IsSupersetOf({"truth", "simulated/dataset"}));
}

TEST_F(RunCache, TheScriptOfACommandIsAnInput) {
  fs::copy(folder_ / "out", folder_ / "own", fs::copy_options::recursive);
  const std::string own = (folder_ / "own/simulated/odometry").string();
  const auto with_script = [&](const std::string& script) {
    write("slam.sh", script);
    fs::permissions(folder_ / "slam.sh", fs::perms::owner_all);
  };
  with_script(kScript);
  write("experiment.yaml",
        std::string(TinyExperiments::kOneFlight) + "odometry: {command: './slam.sh {dataset} {out} " + own + "'}\n");
  EXPECT_THAT(stages_done("out"), IsSupersetOf({"simulated/odometry"}));
  EXPECT_THAT(stages_done("out"), testing::IsEmpty());
  touch(folder_ / "slam.sh");
  EXPECT_THAT(stages_done("out"), testing::IsEmpty());
  with_script(std::string(kScript) + "# another\n");
  const std::set<std::string> done = stages_done("out");
  EXPECT_EQ(done.count("simulated/odometry"), 1U);
  EXPECT_EQ(done.count("simulated/dataset"), 0U);
  EXPECT_THAT(file_text(folder_ / "out/results.json"), HasSubstr("slam.sh")) << "it is one of the run's inputs";
}

std::set<ino_t> inodes(const fs::path& folder) {
  std::set<ino_t> found;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    struct stat status {};
    if (::stat(entry->path().c_str(), &status) == 0) found.insert(status.st_ino);
  }
  return found;
}

std::size_t notes_in(const fs::path& folder) {
  std::error_code error;
  std::size_t count = 0;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    count += entry->path().extension() == ".json" ? 1 : 0;
  return count;
}

TEST_F(RunCache, FramesThatAreThereAfterAKillAreTakenUp) {
  // Only the first stage matters here: the second finds its odometry done.
  const std::string odometry = (folder_ / "out/simulated/odometry").string();
  write("experiment.yaml", R"(name: tiny
place: {source: place/tileset.json, center_local: [0, 0, 100], size: [80, 80, 20]}
alignment: {start: true-poses, method: point-to-mesh}
simulated:
  render: {flight: flight.yaml, samples_per_pixel: 4, outputs: "depth, segmentation"}
odometry: {command: 'cp )" + odometry +
                               "/trajectory.txt " + odometry + "/map.ply {out}'}\n");
  run("whole", {"--threads", "1"});
  const fs::path frames = folder_ / "killed/simulated/.dataset.frames";
  {
    tests::BackgroundProgram program(call("killed", {"--threads", "1"}), folder_ / "first");
    while (program.runs() && notes_in(frames / "frames") < 10)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ASSERT_TRUE(program.runs()) << program.result().err;
  }
  const std::size_t kept = notes_in(frames / "frames");
  EXPECT_LT(kept, std::size_t{TinyExperiments::kFramesOfOne});
  EXPECT_FALSE(fs::exists(folder_ / "killed/simulated/dataset"));
  const std::set<ino_t> before = inodes(frames / "dataset/images");
  run("killed", {"--threads", "2"});
  const std::set<ino_t> after = inodes(folder_ / "killed/simulated/dataset/images");
  std::size_t taken_up = 0;
  for (const ino_t inode : before) taken_up += after.count(inode);
  EXPECT_GE(taken_up, kept) << "their very files";
  EXPECT_FALSE(fs::exists(frames));
  const fs::path whole = folder_ / "whole/simulated/dataset", resumed = folder_ / "killed/simulated/dataset";
  ASSERT_FALSE(base::list_files_recursive(whole).empty());
  EXPECT_EQ(base::list_files_recursive(whole), base::list_files_recursive(resumed));
  for (const std::string& file : base::list_files_recursive(whole))
    EXPECT_TRUE(file_text(whole / file) == file_text(resumed / file)) << file;
}

TEST_F(RunCache, ABusyFolderIsNamedWithItsProcess) {
  write("experiment.yaml", std::string(TinyExperiments::kOneFlight) + "odometry: {command: sleep 30}\n");
  tests::BackgroundProgram program(call("busy"), folder_ / "first");
  while (program.runs() && !fs::exists(folder_ / "busy/stages/simulated-dataset.json"))
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  ASSERT_TRUE(program.runs()) << program.result().err;
  for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--force"}}) {
    const ProgramResult second = run_tileflight(call("busy", more));
    EXPECT_EQ(second.exit_code, 1);
    EXPECT_EQ(tests::line_count(second.err), 1) << second.err;
    EXPECT_THAT(second.err, HasSubstr("process " + std::to_string(program.process())));
    EXPECT_THAT(second.err, HasSubstr("tileflight run"));
    EXPECT_THAT(second.err, Not(HasSubstr("--force")));
  }
  program.kill();
  write("experiment.yaml", TinyExperiments::kOneFlight);
  run("busy");
}

TEST_F(RunCache, ForceDoesAllAgainAndKeepsWhatIsNotOurs) {
  write("out/notes.txt", "mine");
  const std::string results = file_text(folder_ / "out/results.json");
  const ProgramResult forced = run("out", {"--force"});
  EXPECT_THAT(forced.err, Not(HasSubstr("unchanged")));
  EXPECT_EQ(file_text(folder_ / "out/notes.txt"), "mine");
  // Within the folder of a stage it would be lost: the stage refuses.
  write("out/simulated/dataset/notes.txt", "mine");
  const ProgramResult refused = run_tileflight(call("out", {"--force"}));
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, HasSubstr("holds notes.txt, which tileflight did not write"));
  EXPECT_EQ(file_text(folder_ / "out/simulated/dataset/notes.txt"), "mine");
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html")) << "what was there stays until it is replaced";
  fs::remove(folder_ / "out/simulated/dataset/notes.txt");
  run("out");
}

TEST_F(RunCache, RunsShareATruthByItsContent) {
  const std::vector<std::string> only_truth{"--until", "datasets",      "--flight",
                                            "real",    "--truth-cache", (folder_ / "truths").string()};
  const auto extracted = [&](const std::string& out) { return stages_in(run(out, only_truth).err).count("truth"); };
  EXPECT_EQ(extracted("first"), 1U);
  EXPECT_EQ(extracted("second"), 0U);
  EXPECT_TRUE(fs::equivalent(folder_ / "first/truth/mesh.glb", folder_ / "second/truth/mesh.glb")) << "a hard link";
  // The tiles are the same, in another folder and under another experiment file.
  fs::copy(folder_ / "place", folder_ / "elsewhere", fs::copy_options::recursive);
  const std::string text = TinyExperiments::kOneFlight;
  write("experiment.yaml", "truth: {voxel: 1}\n" + std::string(text).replace(text.find("place/tileset.json"), 18,
                                                                             "elsewhere/tileset.json"));
  EXPECT_EQ(extracted("third"), 0U);
  EXPECT_THAT(file_text(folder_ / "third/truth/extract.json"), HasSubstr("elsewhere/tileset.json"));
  EXPECT_THAT(file_text(folder_ / "first/truth/extract.json"), Not(HasSubstr("elsewhere")));
  EXPECT_EQ(file_text(folder_ / "third/truth/mesh.glb"), file_text(folder_ / "out/truth/mesh.glb"));
  // Another voxel, or other bytes in a tile.
  write("experiment.yaml", "truth: {voxel: 2}\n" + text);
  EXPECT_EQ(extracted("fourth"), 1U);
  write("experiment.yaml", text);
  std::string tile = file_text(folder_ / "place/0.glb");
  char& colour = tile[tile.size() * 36 / 100];
  colour = static_cast<char>(colour ^ 1);
  TinyPlace::write_file(folder_ / "place/0.glb", tile);
  EXPECT_EQ(extracted("fifth"), 1U);
  // An entry that was spoilt.
  for (const auto& entry : fs::directory_iterator(folder_ / "truths"))
    if (entry.is_directory()) fs::remove(entry.path() / "voxels.ply");
  EXPECT_EQ(extracted("sixth"), 1U);
  EXPECT_EQ(extracted("seventh"), 0U);
}

/// With all of the default alignment's evidence, of which pictures of the place are a part.
TEST_F(RunCache, ATruthInBlocksGivesTheSameScores) {
  TinyExperiments::two_flights().copy_to(folder_ / "two");
  std::string experiment = TinyExperiments::without_real();
  experiment.insert(experiment.find("voxel: 1.0"), "block: 23, ");
  write("two/experiment.yaml", experiment);
  const fs::path whole = folder_ / "two/out", blocks = folder_ / "two/blocks";
  const ProgramResult result =
      run_tileflight({"run", (folder_ / "two/experiment.yaml").string(), "--out", blocks.string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(fs::exists(blocks / "truth/index.json"));
  EXPECT_THAT(file_text(whole / "simulated/transform.json"), HasSubstr("\"pictures\""));
  for (const char* file : {"simulated/metrics.json", "simulated/errors.ply", "simulated/seen.ply"})
    EXPECT_TRUE(file_text(blocks / file) == file_text(whole / file)) << file;
  for (const char* place : {"ground truth under the maps", "mesh.glb"})
    EXPECT_THAT(file_text(blocks / "report.json"), Not(HasSubstr(place)));
}

}  // namespace
}  // namespace tileflight::run_cache_test
