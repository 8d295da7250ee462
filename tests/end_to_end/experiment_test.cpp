// A whole experiment over a small place: what it leaves, that it does no work twice, that threads change no byte.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "tests/run_program.h"
#include "tests/tiny_experiments.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/imaging/camera.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::experiment_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;
using tests::TinyExperiments;
using tests::TinyPlace;

class Experiment : public ::testing::Test {
 protected:
  /// Begins with the inputs and their finished run in "out".
  Experiment() { TinyExperiments::two_flights().copy_to(folder_.path()); }

  ProgramResult run(const std::string& out, const std::vector<std::string>& more = {}) const {
    std::vector<std::string> call{"run", (folder_ / "experiment.yaml").string(), "--out", (folder_ / out).string()};
    call.insert(call.end(), more.begin(), more.end());
    return run_tileflight(call);
  }

  std::map<std::string, fs::file_time_type> stage_times(const std::string& out) const {
    std::map<std::string, fs::file_time_type> times;
    for (const auto& entry : fs::directory_iterator(folder_ / out / "stages")) {
      times[entry.path().filename().string()] = entry.last_write_time();
    }
    return times;
  }

  tests::TemporaryFolder folder_;
};

void expect_keys(const json& object, const std::vector<std::string>& keys) {
  for (const std::string& key : keys) EXPECT_TRUE(object.contains(key)) << key << " is missing";
}

void expect_flight_results(const json& flight, double fov_deg) {
  expect_keys(flight, {"map", "surface", "trajectory", "frames", "fov_deg", "resolution", "fps", "duration_s", "kind"});
  expect_keys(flight["map"], {"points", "correspondences", "mean", "std", "median", "rmse", "histogram", "cutoff",
                              "truth", "quantization_floor"});
  expect_keys(flight["surface"], {"mean", "std", "median", "rmse", "accuracy", "completeness", "f_score"});
  EXPECT_NEAR(flight["fov_deg"].get<double>(), fov_deg, 1.0);
  EXPECT_NEAR(flight["fps"].get<double>(), 10.0, 1e-3);
  EXPECT_LT(flight["trajectory"]["ate_rmse"].get<double>(), 0.01 * flight["trajectory"]["path_length"].get<double>());
  EXPECT_GT(flight["map"]["points"].get<int>(), 500);
  EXPECT_LT(flight["surface"]["median"].get<double>(), 0.2);
  EXPECT_GT(flight["surface"]["normals"]["mean_abs_cos"].get<double>(), 0.7) << flight["surface"]["normals"];
  EXPECT_GT(flight["entropy"]["share_judged"].get<double>(), 0.5);
  expect_keys(flight["error_budget"], {"voxel", "tiles", "alignment", "path", "odometry", "total", "not_separated"});
  EXPECT_LT(flight["error_budget"]["path"]["metres"].get<double>(), 1.0);
}

TEST_F(Experiment, GivesTheResultsOfTheContractAndDoesNoWorkTwice) {
  // Copied, the run is the same but for its report, which names its files.
  const ProgramResult first = run("out", {"--json"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  json results = json::parse(file_text(folder_ / "printed.json")), copied = json::parse(first.out);
  for (json* one : {&results, &copied}) {
    expect_keys((*one)["provenance"], {"version", "commit", "seed", "inputs", "seconds", "command"});
    for (json& input : (*one)["provenance"]["inputs"]) input.erase("path");
    (*one)["provenance"].erase("command");
  }
  EXPECT_EQ(copied, results);
  expect_keys(results, {"simulated", "real", "comparison", "paper", "provenance"});
  expect_flight_results(results["simulated"], 120.0);
  expect_flight_results(results["real"], 120.0);
  EXPECT_EQ(results["simulated"]["resolution"], json({320, 240}));
  EXPECT_EQ(results["real"]["resolution"], json({256, 192}));
  EXPECT_EQ(results["real"]["kind"], "surrogate");
  expect_keys(results["comparison"], {"mean_difference", "std_difference", "points_ratio", "ks_statistic",
                                      "wasserstein_m", "mean_difference_ci95", "equivalent_within_m"});
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
  EXPECT_TRUE(fs::exists(folder_ / "out/simulated/dataset/visibility/000009.png"));
  EXPECT_TRUE(fs::exists(folder_ / "out/simulated/dataset/pcalib.txt"));
  EXPECT_FALSE(fs::exists(folder_ / "out/real/dataset/visibility"));
  EXPECT_EQ(json::parse(file_text(folder_ / "out/results.json")), json::parse(first.out));

  const auto before = stage_times("out");
  const ProgramResult second = run("out", {"--json"});
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(stage_times("out"), before) << "a stage was done again";
  EXPECT_EQ(second.out, first.out);

  // The run looks interrupted before the second flight was tracked. Only the missing stages run.
  fs::remove(folder_ / "out/stages/real-odometry.json");
  fs::remove_all(folder_ / "out/real/odometry");
  ASSERT_EQ(run("out").exit_code, 0);
  const auto after = stage_times("out");
  for (const char* kept : {"truth.json", "simulated-odometry.json", "real-dataset.json", "real-evaluation.json"}) {
    EXPECT_EQ(after.at(kept), before.at(kept)) << kept;
  }
  EXPECT_NE(after.at("real-odometry.json"), before.at("real-odometry.json"));
}

TEST_F(Experiment, TracksEachFlightMoreThanOnce) {
  const auto of_one_run = stage_times("out");
  const std::string experiment = TinyExperiments::aligned_by_points(TinyExperiments::kTwoFlights);
  TinyPlace::write_file(folder_ / "experiment.yaml", experiment + "odometry: {runs: 2, later: 3, backwards: true}\n");
  const ProgramResult first = run("out", {"--json"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_EQ(stage_times("out").at("real-odometry.json"), of_one_run.at("real-odometry.json"))
      << "the first run is the same beside others";
  const json results = json::parse(first.out);
  for (const char* flight : {"simulated", "real"}) {
    const json& runs = results[flight]["runs"];
    EXPECT_EQ(runs["n"], 4);
    EXPECT_EQ(runs["failed"], 0) << runs["list"];
    EXPECT_EQ(runs["distinct"], 4);
    ASSERT_EQ(runs["list"].size(), 4U);
    EXPECT_EQ(runs["list"][0]["mean"], results[flight]["map"]["mean"]) << "the first run is the flight's result";
    EXPECT_EQ(runs["list"][1]["from"], 3);
    EXPECT_EQ(runs["list"][3]["name"], "2-backwards");
    EXPECT_EQ(runs["spread"]["map"]["mean"]["n"], 4);
    EXPECT_GT(runs["spread"]["trajectory"]["ate_rmse"]["std"].get<double>(), 0.0);
    const json& ci = runs["spread"]["surface"]["median"]["ci95"];
    EXPECT_LT(ci[0].get<double>(), ci[1].get<double>());
  }
  const json& comparison = results["comparison"];
  EXPECT_EQ(comparison["unit"], "runs");
  EXPECT_EQ(comparison["runs"], json({{"simulated", 4}, {"real", 4}}));
  EXPECT_TRUE(comparison["within_run"].is_object());

  const auto before = stage_times("out");
  ASSERT_EQ(run("out").exit_code, 0);
  EXPECT_EQ(stage_times("out"), before) << "a stage was done again";

  TinyPlace::write_file(folder_ / "experiment.yaml", experiment);
  const ProgramResult once = run("out", {"--json"});
  ASSERT_EQ(once.exit_code, 0) << once.err;
  EXPECT_EQ(stage_times("out").at("real-odometry.json"), before.at("real-odometry.json"))
      << "the first run is the same without others";
  EXPECT_FALSE(fs::exists(folder_ / "out/real/runs/2"));
  EXPECT_TRUE(json::parse(once.out)["real"]["runs"].is_null());
  EXPECT_EQ(json::parse(once.out)["comparison"]["unit"], "blocks");
}

TEST_F(Experiment, ARunThatFailsIsAResult) {
  TinyPlace::write_file(folder_ / "experiment.yaml", TinyExperiments::without_real() + "odometry: {runs: 2, later: " +
                                                         std::to_string(TinyExperiments::kFramesOfTwo - 3) + "}\n");
  const ProgramResult first = run("out", {"--json"});  // three frames are left for the second run
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const json runs = json::parse(first.out)["simulated"]["runs"];
  EXPECT_EQ(runs["failed"], 1) << runs["list"];
  EXPECT_TRUE(runs["list"][1]["failed"].is_string());
  EXPECT_TRUE(runs["list"][1]["mean"].is_null());
  EXPECT_EQ(runs["spread"]["map"]["mean"]["n"], 1);
}

TEST_F(Experiment, MapsAreComparedAndRankedByFolder) {
  const fs::path csv = folder_ / "table.csv", tex = folder_ / "table.tex";
  const auto compare = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"compare", "--json"});
    return run_tileflight(more);
  };
  const std::string a = (folder_ / "out").string();
  const ProgramResult all = compare({a, a + "/real/metrics.json", "--csv", csv.string(), "--tex", tex.string()});
  ASSERT_EQ(all.exit_code, 0) << all.err;
  const json table = json::parse(all.out);
  ASSERT_EQ(table["maps"].size(), 3U);
  EXPECT_EQ(table["maps"][2]["name"], "out/real #2");
  EXPECT_EQ(table["pairs"].size(), 3U);
  EXPECT_EQ(table["pairs"][2]["mean_difference"], 0.0) << "the same map twice";
  EXPECT_EQ(tests::line_count(file_text(csv)), 4);
  EXPECT_EQ(tests::line_count(file_text(folder_ / "table-pairs.csv")), 4);
  EXPECT_THAT(file_text(tex), testing::HasSubstr("out/simulated & "));

  const json two = json::parse(compare({a + "/simulated/metrics.json", a + "/real/metrics.json"}).out);
  const json comparison = json::parse(file_text(folder_ / "out/comparison.json"));
  for (const auto& [key, value] : comparison.items()) EXPECT_EQ(two[key], value) << key;

  fs::copy(folder_ / "out", folder_ / "b", fs::copy_options::recursive);
  json better = json::parse(file_text(folder_ / "b/real/metrics.json"));
  better["surface"]["median"] = 1e-6;
  TinyPlace::write_file(folder_ / "b/real/metrics.json", better.dump());
  const std::string b = (folder_ / "b").string();
  const ProgramResult ranking = compare({"--ranking", "--by", "surface.median", a, b});
  ASSERT_EQ(ranking.exit_code, 0) << ranking.err;
  EXPECT_EQ(json::parse(ranking.out)["list"][1]["real"], 1e-6);
  EXPECT_TRUE(json::parse(ranking.out)["tau_b"].is_null()) << "simulation sees no difference";
  const ProgramResult wrong = compare({"--ranking", "--by", "map.meen", a, b});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_THAT(wrong.err, testing::HasSubstr("has no number 'map.meen'"));
}

TEST_F(Experiment, FliesVariantsOfTheSimulatedFlight) {
  TinyPlace::write_file(folder_ / "experiment.yaml", R"(name: ablation
place:
  source: place/tileset.json
  center_local: [0, 0, 100]
  size: [80, 80, 20]
alignment: {start: true-poses, method: point-to-mesh}
simulated:
  render: {flight: flight.yaml, max_frames: 40}
variants:
  - {name: noise, degrade: {white_electrons: 3000, read_noise_electrons: 5}}
  - {name: small, resolution: [256, 192]}
  - {name: dark, degrade: {exposure_steps: [{time: 0, gain: 0.0001}]}}
  - {name: sparse, odometry: {points_per_keyframe: 500}}
)");
  const ProgramResult first = run("a", {"--json"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const json results = json::parse(first.out);
  const json& lines = results["ablation"];
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_EQ(lines[0]["name"], "as it is");
  EXPECT_EQ(lines[0]["points"], results["simulated"]["map"]["points"]);
  for (const int i : {1, 2}) {
    ASSERT_TRUE(lines[i]["failed"].is_null()) << lines[i];
    EXPECT_GT(lines[i]["points"].get<int>(), 100) << lines[i];
    EXPECT_NE(lines[i]["ate_rmse_m"], lines[0]["ate_rmse_m"]);
    EXPECT_GT(lines[i]["ate_share"].get<double>(), 0);
  }
  EXPECT_TRUE(lines[3]["failed"].is_string()) << "black pictures: " << lines[3];
  EXPECT_TRUE(lines[3]["points"].is_null());
  EXPECT_EQ(json::parse(file_text(folder_ / "a/variants/small/results.json"))["simulated"]["resolution"],
            json({256, 192}));
  EXPECT_LT(lines[4]["points"], lines[0]["points"]);
  EXPECT_TRUE(fs::equivalent(folder_ / "a/variants/sparse/simulated/dataset/images/000003.jpg",
                             folder_ / "a/simulated/dataset/images/000003.jpg"))
      << "another odometry needs no other images";
  EXPECT_EQ(tests::line_count(file_text(folder_ / "a/ablation.csv")), 6);
  const ProgramResult table = run_tileflight({"compare", (folder_ / "a").string(), "--against", "a/simulated", "--rows",
                                              "*/simulated", "--columns", "ate_rmse_m,points", "--json"});
  ASSERT_EQ(table.exit_code, 0) << table.err;
  EXPECT_EQ(json::parse(table.out)["maps"].size(), 4U) << "dark has none";
  EXPECT_EQ(json::parse(table.out)["pairs"].size(), 3U);
  EXPECT_THAT(file_text(folder_ / "a/report.html"), testing::HasSubstr("Variants of the simulated flight"));
  const auto kept = fs::last_write_time(folder_ / "a/variants/noise/stages/simulated-odometry.json");
  ASSERT_EQ(run("a").exit_code, 0);
  EXPECT_EQ(fs::last_write_time(folder_ / "a/variants/noise/stages/simulated-odometry.json"), kept);
}

TEST_F(Experiment, VariantsThatCannotBeAreOneLine) {
  const auto expect_refused = [&](const std::string& variants, const std::string& cause) {
    TinyPlace::write_file(folder_ / "experiment.yaml",
                          std::string(TinyExperiments::kTwoFlights) + "variants:\n" + variants);
    const ProgramResult result = run("a");
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, testing::HasSubstr(cause));
  };
  expect_refused("  - {degrade: {vignetting: 0.5}}\n", "names a folder");
  expect_refused("  - {name: ../up}\n", "names a folder");
  expect_refused("  - {name: a}\n  - {name: a}\n", "two variants are called 'a'");
  expect_refused("  - {name: a, degrad: {vignetting: 0.5}}\n", "degrade");
}

constexpr const char* kFollowing = R"(name: following
place:
  source: place/tileset.json
  center_local: [0, 0, 100]
  size: [80, 80, 20]
alignment: {start: true-poses, method: point-to-mesh}
simulated:
  render: {follow: real}
real:
  kind: surrogate
  render: {flight: flight.yaml}
)";

TEST_F(Experiment, FliesTheOtherFlightAgain) {
  TinyPlace::write_file(folder_ / "experiment.yaml", kFollowing);
  const ProgramResult first = run("a", {"--json"});
  ASSERT_EQ(first.exit_code, 0) << first.err;
  const json results = json::parse(first.out);
  const json& again = results["reproduction"];
  EXPECT_GT(again["pairs"].get<int>(), TinyExperiments::kFramesOfTwo * 7 / 10);
  EXPECT_EQ(again["poses"], "true");
  EXPECT_GT(again["overlap"]["p10"].get<double>(), 0.9);
  EXPECT_GT(again["ncc"]["p10"].get<double>(), 0.8) << again.dump(1);
  EXPECT_LT(again["position_m"]["p90"].get<double>(), 0.3);
  EXPECT_LT(again["rotation_deg"]["p90"].get<double>(), 1.0);
  ASSERT_TRUE(again["time_offset_s"].is_number()) << again.dump(1);
  EXPECT_NEAR(again["time_offset_s"].get<double>(), 0.0, 0.03);
  EXPECT_GT(again["excerpt"]["to_s"].get<double>(), again["excerpt"]["from_s"].get<double>() + 3);
  EXPECT_EQ(tests::line_count(file_text(folder_ / "a/reproduction.csv")), 1 + again["pairs"].get<int>());
  EXPECT_EQ(results["simulated"]["resolution"], results["real"]["resolution"]);
  const json& failure = results["failure"];
  EXPECT_EQ(failure["frames"]["questions"], results["real"]["frames"]);
  EXPECT_EQ(failure["frames"]["neither"], failure["frames"]["questions"]) << "neither lost a frame";
  EXPECT_TRUE(failure["frames"]["phi"].is_null());
  EXPECT_GT(failure["places"]["cells"].get<int>(), 100);
  EXPECT_GT(failure["places"]["missed"]["phi"].get<double>(), 0.3) << failure;
  EXPECT_EQ(tests::line_count(file_text(folder_ / "a/missed-places.csv")), 1 + failure["places"]["cells"].get<int>());
  const auto before = stage_times("a");
  ASSERT_EQ(run("a").exit_code, 0);
  EXPECT_EQ(stage_times("a"), before) << "a stage was done again";
}

TEST_F(Experiment, WhatCannotBeFollowedIsOneLine) {
  const auto expect_refused = [&](const std::string& from, const std::string& to, const std::string& cause) {
    std::string text = kFollowing;
    text.replace(text.find(from), from.size(), to);
    TinyPlace::write_file(folder_ / "experiment.yaml", text);
    const ProgramResult result = run("a");
    EXPECT_EQ(result.exit_code, 1);
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, testing::HasSubstr(cause));
  };
  expect_refused("{follow: real}", "{follow: real, flight: flight.yaml}", "does not go together");
  expect_refused("{follow: real}", "{follow: reel}", "real");
  expect_refused("render: {flight: flight.yaml}", "render: {follow: real}", "itself");
  expect_refused("real:\n  kind: surrogate\n  render: {flight: flight.yaml}\n", "", "which is missing");
}

/// A file that names others, which lie elsewhere where the experiment is copied from.
std::string text_without_folders(const fs::path& file) {
  return std::regex_replace(file_text(file), std::regex("\"/[^\"]*/"), "\"");
}

TEST_F(Experiment, ThreadsChangeNoByte) {
  ASSERT_EQ(run("one", {"--threads", "1"}).exit_code, 0);  // "out" is of two
  std::set<std::string> compared;
  for (const auto& entry : fs::recursive_directory_iterator(folder_ / "one")) {
    const std::string name = fs::relative(entry.path(), folder_ / "one").string();
    const bool times_inside = name.ends_with("extract.json") || name.ends_with("odometry.json") ||
                              name == "results.json" || name == "report.html" || name == "report.json" ||
                              name.starts_with("stages") || name == ".file-hashes";
    if (!entry.is_regular_file() || times_inside) continue;
    const auto text = name.ends_with("dataset.yaml") ? text_without_folders : file_text;
    EXPECT_EQ(text(entry.path()), text(folder_ / "out" / name)) << name;
    compared.insert(name);
  }
  for (const char* name :
       {"simulated/metrics.json", "real/metrics.json", "simulated/odometry/map.ply", "truth/voxels.binvox",
        "simulated/dataset/images/000000.jpg", "comparison.json", "truth/mesh.glb"}) {
    EXPECT_TRUE(compared.contains(name)) << name;
  }
}

TEST_F(Experiment, AnotherProgramCanDoTheOdometry) {
  fs::copy(folder_ / "out", folder_ / "outside", fs::copy_options::recursive);
  const std::string own = (folder_ / "out/simulated/odometry").string();
  TinyPlace::write_file(folder_ / "experiment.yaml", TinyExperiments::without_real() +
                                                         "odometry:\n  command: test -e {dataset}/times.txt && cp " +
                                                         own + "/trajectory.txt " + own + "/map.ply {out}\n");
  const ProgramResult result = run("outside", {"--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  // Points and poses are the same. Only the keyframes that saw a point are unknown for another program.
  const json outside = json::parse(result.out)["simulated"]["map"],
             known = json::parse(file_text(folder_ / "out/simulated/metrics.json"))["map"];
  EXPECT_EQ(outside["points"], known["points"]);
  EXPECT_NEAR(outside["mean"].get<double>(), known["mean"].get<double>(), 0.02);

  TinyPlace::write_file(folder_ / "experiment.yaml",
                        TinyExperiments::without_real() + "odometry:\n  command: echo cannot start; false\n");
  const ProgramResult failed = run("failed");
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.err, ::testing::HasSubstr("cannot start"));
}

TEST_F(Experiment, AnotherSystemCanDoTheOdometry) {
  fs::copy(folder_ / "out", folder_ / "other", fs::copy_options::recursive);
  fs::create_directories(folder_ / "slam");
  const std::string own = (folder_ / "out/simulated/odometry").string();
  const std::string manifest =
      "name: mine\ntitle: My SLAM\ntakes: {inputs: [images], lenses: [any]}\nleaves: {map: map.ply}\n";
  TinyPlace::write_file(folder_ / "slam/adapter.yaml", manifest);
  TinyPlace::write_file(folder_ / "slam/run",
                        "#!/bin/sh\ntest $SEED = 7 && cp " + own + "/trajectory.txt " + own + "/map.ply \"$OUT\"\n");
  fs::permissions(folder_ / "slam/run", fs::perms::owner_all);
  const std::string simulated = TinyExperiments::aligned_by_points(TinyExperiments::without_real());
  TinyPlace::write_file(folder_ / "experiment.yaml", simulated + "odometry: {system: slam, seed: 7}\n");
  const ProgramResult result = run("other", {"--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json results = json::parse(result.out);
  EXPECT_EQ(results["simulated"]["odometry"]["system"]["title"], "My SLAM");
  EXPECT_EQ(results["simulated"]["map"]["points"],
            json::parse(file_text(folder_ / "out/simulated/metrics.json"))["map"]["points"]);
  EXPECT_THAT(results["provenance"]["inputs"].dump(), ::testing::HasSubstr("slam/run"));
  const auto before = stage_times("other");
  ASSERT_EQ(run("other").exit_code, 0);
  EXPECT_EQ(stage_times("other"), before);

  TinyPlace::write_file(folder_ / "slam/adapter.yaml", manifest + "needs: {programs: [no-such-slam]}\n");
  const ProgramResult missing = run("missing");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_EQ(tests::line_count(missing.err), 1) << missing.err;
  EXPECT_THAT(missing.err,
              ::testing::HasSubstr("My SLAM: is not installed: the program 'no-such-slam' is not in PATH"));
  EXPECT_FALSE(fs::exists(folder_ / "missing")) << "nothing is rendered first";
}

/// A rig, rendered and then ingested from its own pictures: both are datasets of all cameras, which the report shows.
TEST_F(Experiment, ARigHasAllItsCamerasInTheReport) {
  const std::string own = (folder_ / "out/simulated/odometry").string();
  std::string flight = TinyExperiments::flight(TinyExperiments::kFramesOfTwo);
  const std::string one = "camera: camera.yaml\n";
  flight.replace(flight.find(one), one.size(),
                 "cameras:\n  - {name: left, camera: camera.yaml}\n  - {name: right, camera: camera.yaml, position: "
                 "[0.3, 0, 0], resolution: [160, 120]}\n");
  TinyPlace::write_file(folder_ / "flight.yaml", flight);
  const std::string simulated = TinyExperiments::aligned_by_points(TinyExperiments::without_real());
  const std::string odometry = "odometry:\n  command: cp " + own + "/trajectory.txt " + own + "/map.ply {out}\n";
  TinyPlace::write_file(folder_ / "experiment.yaml", simulated + odometry);
  fs::copy(folder_ / "out", folder_ / "both", fs::copy_options::recursive);
  ProgramResult result = run("both");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  fs::copy(folder_ / "both/simulated/dataset", folder_ / "flown", fs::copy_options::recursive);
  TinyPlace::write_file(folder_ / "experiment.yaml", simulated + odometry +
                                                         R"(real:
  kind: surrogate
  ingest:
    video: {left: flown, right: flown/cameras/right}
    camera: flown/camchain.yaml
    groundtruth: flown/groundtruth.txt
)");
  result = run("both");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* key : {"simulated", "real"}) {
    const fs::path dataset = folder_ / "both" / key / "dataset";
    EXPECT_TRUE(file_text(dataset / "cameras/right/times.txt") == file_text(folder_ / "flown/cameras/right/times.txt"));
    EXPECT_TRUE(fs::exists(dataset / "camchain.yaml"));
  }
  const std::string page = file_text(folder_ / "both/report.html");
  EXPECT_THAT(page, ::testing::HasSubstr("<summary>Simulated flight, camera right</summary>"));
  EXPECT_THAT(page, ::testing::HasSubstr("<summary>Surrogate flight, camera right</summary>"));
  const auto before = stage_times("both");
  ASSERT_EQ(run("both").exit_code, 0);
  EXPECT_EQ(stage_times("both"), before);
  // Another camera's files are inputs, too.
  TinyPlace::write_file(folder_ / "flown/cameras/right/times.txt", "000000 0 0\n000001 0.1 0\n");
  ASSERT_EQ(run("both").exit_code, 0);
  EXPECT_NE(stage_times("both"), before);
  EXPECT_THAT(file_text(folder_ / "both/real/dataset/dataset.yaml"), ::testing::HasSubstr("right stops at 0.1 s"));
}

TEST_F(Experiment, OdometryTakesWhatItsCommandTakes) {
  imaging::GrayImage mask(320, 240, 255);
  for (int y = 200; y < 240; ++y) std::fill_n(&mask(0, y), 320, std::uint8_t{0});
  imaging::write_gray(folder_ / "mask.png", mask);
  const std::string simulated_only = TinyExperiments::aligned_by_points(TinyExperiments::without_real());
  TinyPlace::write_file(folder_ / "experiment.yaml",
                        simulated_only +
                            "odometry: {mask: mask.png, rectify_fov: 90, colmap: true, debug_pictures: true, "
                            "min_parallax: 1.5, dense: false, loop_closure: true, fixed_intrinsics: true}\n");
  const ProgramResult result = run("out", {"--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const fs::path odometry = folder_ / "out/simulated/odometry";
  EXPECT_NEAR(imaging::read_calibration(odometry / "camera.yaml").camera.horizontal_fov_deg(), 90.0, 1e-9);
  EXPECT_TRUE(fs::exists(odometry / "colmap/points3D.txt"));
  EXPECT_TRUE(json::parse(file_text(odometry / "odometry.json")).contains("loops"));
  const fs::path pictures = folder_ / "out/simulated/keyframe_pictures";
  EXPECT_EQ(base::read_folder_marker(pictures)->files.size(),
            json::parse(file_text(odometry / "odometry.json"))["keyframes"].get<std::size_t>());

  const auto before = stage_times("out");
  std::fill_n(&mask(0, 190), 320, std::uint8_t{0});
  imaging::write_gray(folder_ / "mask.png", mask);
  ASSERT_EQ(run("out").exit_code, 0);
  EXPECT_NE(stage_times("out").at("simulated-odometry.json"), before.at("simulated-odometry.json"))
      << "another mask is another input";

  TinyPlace::write_file(folder_ / "experiment.yaml", simulated_only + "odometry: {rectify_fov: 180}\n");
  const ProgramResult refused = run("refused");
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.err, ::testing::HasSubstr("odometry.rectify_fov"));
}

}  // namespace
}  // namespace tileflight::experiment_test
