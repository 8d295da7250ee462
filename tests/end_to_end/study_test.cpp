// Other SLAM systems, and studies that compare them, on a small place.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/run_program.h"
#include "tests/same_files.h"
#include "tests/slurm_cluster.h"
#include "tests/source_folder.h"
#include "tests/tiny_experiments.h"
#include "tests/tiny_flight.h"

namespace tileflight::study_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyExperiments;
using tests::TinyPlace;

/// The k-th fenced block of a language in a document.
std::string code_block(const fs::path& document, const std::string& language, const std::string& containing) {
  const std::string text = file_text(document), fence = "```" + language + "\n";
  for (std::size_t at = text.find(fence); at != std::string::npos; at = text.find(fence, at + 1)) {
    const std::size_t begin = at + fence.size();
    const std::string block = text.substr(begin, text.find("```", begin) - begin);
    if (block.find(containing) != std::string::npos) return block;
  }
  return "";
}

/// The example of docs/systems.md, as its reader would copy it.
void write_documented_adapter(const fs::path& folder) {
  fs::create_directories(folder);
  const fs::path page = tests::source_folder() / "docs/systems.md";
  TinyPlace::write_file(folder / "adapter.yaml", code_block(page, "yaml", "Truth with noise"));
  TinyPlace::write_file(folder / "run", code_block(page, "python", "groundtruth.txt"));
  fs::permissions(folder / "run", fs::perms::owner_all);
}

class Study : public ::testing::Test {
 protected:
  void SetUp() override {
    TinyExperiments::write_two_flights(folder_.path());
    // Enough for every system and for scores; what is compared is one study with the same done otherwise.
    TinyPlace::write_file(folder_ / "flight.yaml", TinyExperiments::flight(30));
    write_documented_adapter(folder_ / "noisy");
    // A slow one, so that there is a middle in which to stop.
    write_documented_adapter(folder_ / "slow");
    TinyPlace::write_file(folder_ / "slow/adapter.yaml",
                          "name: slow\ntakes: {inputs: [images], lenses: [any]}\ncommand: sleep 0.6; ../noisy/run\n");
    TinyPlace::write_file(folder_ / "study.yaml", R"(name: small
repetitions: 2
places: {tiny: experiment.yaml}
systems:
  tileflight:
  noisy: {adapter: noisy}
  slow: {adapter: slow}
  kiss-icp:
rank_by: ate
# By the map's points alone, at an eighth of the cost of pictures of the place.
alignment: {start: true-poses, method: point-to-mesh}
)");
  }

  std::vector<std::string> command(const std::string& out, const std::vector<std::string>& more) const {
    std::vector<std::string> words{
        "study",    (folder_ / "study.yaml").string(), "--out", (folder_ / out).string(), "--json",
        "--places", (folder_ / "places").string()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  json study(const std::string& out, const std::vector<std::string>& more) const {
    const ProgramResult result = run_tileflight(command(out, more));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(file_text(folder_ / out / "study.json"));
  }
  /// Without what two runs of the same cannot share.
  static json without_times(json study) {
    for (json& run : study["runs"])
      for (const char* key : {"seconds", "cpu_seconds", "peak_memory_mb", "threads"}) run.erase(key);
    return study;
  }

  tests::TemporaryFolder folder_;
};

TEST_F(Study, IsTheSameOneByOneAfterBeingKilledAndBySnakemake) {
  const ProgramResult dry = run_tileflight(command("dry", {"--dry-run"}));
  EXPECT_EQ(dry.exit_code, 0) << dry.err;
  EXPECT_EQ(json::parse(dry.out)["runs"].size(), 16U);
  EXPECT_FALSE(fs::exists(folder_ / "dry"));

  const json whole = study("out", {"--no-snakemake"});
  EXPECT_EQ(whole["ranking"][0]["system"], "tileflight");
  EXPECT_TRUE(whole["ranking"][3]["score"].is_null()) << "kiss-icp needs scans";
  for (const json& run : whole["runs"]) {
    EXPECT_EQ(run["completed"], run["system"] != "kiss-icp") << run["reason"];
    if (run["system"] == "kiss-icp") {
      EXPECT_EQ(run["applicable"], false);
      EXPECT_TRUE(run["ate_rmse"].is_null());
    } else if (run["system"] == "tileflight") {
      EXPECT_GT(run["f_score"], 0.0);
      EXPECT_LT(run["ate_rmse"], 0.1);
    } else {
      EXPECT_NEAR(run["ate_rmse"], 0.1 * std::sqrt(3.0), 0.05) << "noise of 0.1 m on each axis";
    }
  }
  EXPECT_EQ(whole["kendall_tau"]["systems"], 3);
  const json transform = json::parse(file_text(folder_ / "out/runs/tiny/simulated/tileflight/1/transform.json"));
  EXPECT_EQ(transform["method"], "icp-point-to-mesh") << "as the study says";
  const std::string page = file_text(folder_ / "out/study.html");
  EXPECT_THAT(page, HasSubstr("the ranking rests on 1 place"));
  EXPECT_EQ(page.find("http://"), std::string::npos);
  EXPECT_EQ(page.find(" src=\"http"), std::string::npos);

  // Killed with all it started, and started again: the same bytes but for times.
  const pid_t child = fork();
  if (child == 0) {
    setpgid(0, 0);
    std::vector<std::string> words = command("killed", {"--no-snakemake", "--quiet"});
    words.insert(words.begin(), TILEFLIGHT_BINARY);
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    execv(TILEFLIGHT_BINARY, arguments.data());
    _exit(127);
  }
  for (int i = 0; i < 600 && !fs::exists(folder_ / "killed/runs/tiny/simulated/slow/1"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  kill(-child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(fs::exists(folder_ / "killed/study.json"));
  EXPECT_EQ(without_times(study("killed", {"--no-snakemake"})), without_times(whole));

  if (std::system("command -v snakemake > /dev/null") != 0) GTEST_SKIP() << "snakemake is not installed";
  EXPECT_EQ(without_times(study("parallel", {"--jobs", "2"})), without_times(whole));
}

/// Without `alignment:`, maps are aligned by all the evidence, of which pictures of the place are a part.
TEST_F(Study, AlignsByPicturesOfThePlaceUnlessToldOtherwise) {
  TinyPlace::write_file(folder_ / "flight.yaml", TinyExperiments::flight(24));
  TinyPlace::write_file(folder_ / "camera.yaml", TinyPlace::camera_of_quarter_size());
  TinyPlace::write_file(folder_ / "study.yaml", R"(name: small
places: {tiny: {experiment: experiment.yaml, flights: [simulated]}}
systems: {tileflight: }
)");
  const json runs = study("out", {"--no-snakemake"})["runs"];
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs[0]["completed"], true) << runs[0]["reason"];
  EXPECT_LT(runs[0]["alignment_metres"].get<double>(), 0.1);
  EXPECT_LT(runs[0]["ate_rmse"].get<double>(), 0.05);
  EXPECT_GT(runs[0]["f_score"].get<double>(), 0.0);
  const json transform = json::parse(file_text(folder_ / "out/runs/tiny/simulated/tileflight/1/transform.json"));
  EXPECT_EQ(transform["method"], "pictures");
  EXPECT_EQ(transform["start"], "places") << "a study gives no true poses";
  EXPECT_TRUE(transform["warnings"].empty()) << transform["warnings"];
}

/// Two nodes, one of which dies in the middle.
TEST_F(Study, SlurmGoesOnWhenANodeDies) {
  if (std::system("command -v snakemake > /dev/null") != 0) GTEST_SKIP() << "snakemake is not installed";
  if (!tests::SlurmCluster::is_possible()) GTEST_SKIP() << "Slurm is not installed, or this is not root";
  TinyPlace::write_file(folder_ / "study.yaml", R"(name: small
places: {tiny: {experiment: experiment.yaml, flights: [simulated]}}
systems: {noisy: {adapter: noisy}, slow: {adapter: slow}}
rank_by: ate
)");
  TinyPlace::write_file(folder_ / "slow/adapter.yaml",
                        "name: slow\ntakes: {inputs: [images], lenses: [any]}\ncommand: sleep 5; ../noisy/run\n");
  const json local = study("local", {"--no-snakemake"});
  tests::SlurmCluster cluster;
  std::string dead_node;
  std::thread power_cut([&] {
    // The slow system's folder is there as soon as its task runs.
    for (int i = 0; i < 900 && !fs::exists(folder_ / "cluster/runs/tiny/simulated/slow/1"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
    std::this_thread::sleep_for(std::chrono::seconds(1));
    dead_node = cluster.kill_busy_node(tests::SlurmCluster::Notice::kSilence);
    cluster.hurry_requeued_job();
  });
  const ProgramResult result = run_tileflight(command("cluster", {"--slurm", "--jobs", "2"}), cluster.environment());
  power_cut.join();
  ASSERT_EQ(result.exit_code, 0) << result.err << file_text(folder_ / "cluster/logs/snakemake.txt");
  EXPECT_THAT(dead_node, ::testing::AnyOf("n1", "n2")) << "nothing ran when a node was to die";
  const json study = json::parse(file_text(folder_ / "cluster/study.json"));
  EXPECT_EQ(without_times(study), without_times(local));

  // The blocks of a truth, on the node that is left.
  std::vector<std::string> extract{"extract", (folder_ / "place").string(), "--block", "40", "--threads", "1", "--out"};
  const auto with = [&](const std::string& out, const std::vector<std::string>& more) {
    std::vector<std::string> words = extract;
    words.push_back((folder_ / out).string());
    words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  ASSERT_EQ(run_tileflight(with("alone", {})).exit_code, 0);
  const ProgramResult blocks = run_tileflight(with("blocks", {"--slurm", "--jobs", "2"}), cluster.environment());
  ASSERT_EQ(blocks.exit_code, 0) << blocks.err << file_text(folder_ / ".blocks.tasks/logs/snakemake.txt");
  tests::expect_same_files(folder_ / "alone", folder_ / "blocks", "extract.json");
}

/// Folders of other programs' layouts, as they lie: the paths are scored by the true poses that they hold.
TEST(StudyOfDatasets, TakesFoldersFromElsewhereAsTheyLie) {
  const tests::TemporaryFolder folder;
  tests::TinyFlight::copy_to(folder / "own");
  std::string datasets;
  for (const char* layout : {"euroc", "vslamlab"}) {
    const ProgramResult exported = run_tileflight(
        {"export", (folder / "own").string(), "--layout", layout, "--out", (folder / layout).string(), "--quiet"});
    ASSERT_EQ(exported.exit_code, 0) << exported.err;
    datasets += std::string(layout) + ": " + layout + ", ";
  }
  fs::copy(folder / "euroc", folder / "untouched", fs::copy_options::recursive);
  write_documented_adapter(folder / "noisy");
  TinyPlace::write_file(folder / "study.yaml", "places: {hills: {datasets: {" + datasets +
                                                   "own: own}}}\nrank_by: ate\nsystems: {tileflight: , noisy: "
                                                   "{adapter: noisy}}\n");
  const auto run = [&] {
    const ProgramResult result = run_tileflight(
        {"study", (folder / "study.yaml").string(), "--out", (folder / "out").string(), "--no-snakemake", "--quiet"});
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(file_text(folder / "out/study.json"));
  };
  const json study = run();
  ASSERT_EQ(study["runs"].size(), 6U);
  for (const json& run : study["runs"]) {
    EXPECT_EQ(run["completed"], true) << run["reason"];
    EXPECT_EQ(run["frames_tracked"], tests::TinyFlight::kFrames) << run["flight"];
    EXPECT_TRUE(run["f_score"].is_null());
    if (run["system"] == "tileflight")
      EXPECT_LT(run["ate_rmse"], 0.02) << run["flight"];
    else
      EXPECT_NEAR(run["ate_rmse"], 0.1 * std::sqrt(3.0), 0.05) << run["flight"];
  }
  EXPECT_EQ(study["ranking"][0]["system"], "tileflight");
  EXPECT_TRUE(study["kendall_tau"].is_null()) << "nobody flew there in simulation";
  const std::string page = file_text(folder / "out/study.html");
  EXPECT_THAT(page, HasSubstr("Image of the flight"));
  for (const char* name : {"hills, euroc", "hills, vslamlab", "hills, own"}) EXPECT_THAT(page, HasSubstr(name));
  tests::expect_same_files(folder / "euroc", folder / "untouched");

  // Another content is another run; the others are not run again.
  fs::remove_all(folder / "euroc");
  tests::TinyFlight::copy_to(folder / "euroc");
  const auto made = [&](const char* layout) {
    return fs::last_write_time(folder / "out/runs/hills" / layout / "noisy/1/odometry/odometry.json");
  };
  const auto euroc = made("euroc"), vslamlab = made("vslamlab");
  run();
  EXPECT_GT(made("euroc"), euroc);
  EXPECT_EQ(made("vslamlab"), vslamlab);
}

TEST(OtherSystem, ColmapMapsAFlight) {
  if (std::system("command -v colmap > /dev/null") != 0) GTEST_SKIP() << "colmap is not installed";
  const tests::TemporaryFolder folder;
  TinyPlace::write(folder / "place");
  TinyPlace::write_file(folder / "camera.yaml", TinyPlace::kCamera);
  // A few pictures, far enough apart for COLMAP's first pair.
  std::string flight = TinyExperiments::flight(14);
  flight.replace(flight.find("fps: 10"), 7, "fps: 2");
  TinyPlace::write_file(folder / "flight.yaml", flight);
  const ProgramResult rendered =
      run_tileflight({"render", (folder / "place").string(), "--flight", (folder / "flight.yaml").string(), "--out",
                      (folder / "data").string(), "--quiet"});
  ASSERT_EQ(rendered.exit_code, 0) << rendered.err;
  const ProgramResult mapped = run_tileflight({"odometry", (folder / "data").string(), "--system", "colmap", "--out",
                                               (folder / "colmap").string(), "--json", "--time-limit", "300"});
  ASSERT_EQ(mapped.exit_code, 0) << mapped.err << file_text(folder / "colmap/system.log");
  const json about = json::parse(mapped.out);
  EXPECT_GE(about["frames_tracked"], 10);
  EXPECT_GT(about["points"], 50);
  EXPECT_GT(about["system"]["cpu_seconds"], 0.5);
  const ProgramResult scored = run_tileflight({"evaluate", "--trajectory", (folder / "colmap/trajectory.txt").string(),
                                               "--truth-trajectory", (folder / "data/groundtruth.txt").string(),
                                               "--out", (folder / "metrics.json").string(), "--json"});
  ASSERT_EQ(scored.exit_code, 0) << scored.err;
  EXPECT_LT(json::parse(scored.out)["trajectory"]["ate_rmse"], 0.1);
}

TEST(OtherSystem, WhatCannotRunIsOneLine) {
  const tests::TemporaryFolder folder;
  const ProgramResult unknown =
      run_tileflight({"odometry", "data", "--system", "colmpa", "--out", (folder / "o").string()});
  EXPECT_EQ(unknown.exit_code, 1);
  EXPECT_THAT(unknown.err, HasSubstr("did you mean 'colmap'?"));
  EXPECT_EQ(tests::line_count(unknown.err), 1);
  EXPECT_EQ(run_tileflight({"odometry", "data", "--time-limit", "5", "--out", (folder / "o").string()}).exit_code, 2);
  const ProgramResult list = run_tileflight({"systems", "--json"});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  EXPECT_GE(json::parse(list.out)["systems"].size(), 9U);
}

}  // namespace
}  // namespace tileflight::study_test
