#include "tileflight/experiments/study/run_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <thread>

#include "tests/refusal.h"
#include "tests/run_program.h"
#include "tests/tiny_flight.h"
#include "tileflight/experiments/study/study_results.h"
#include "tileflight/experiments/study/test_study.h"

namespace tileflight::study::run_study_test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using tests::refusal_of;

/// A study whose tasks call a stand-in for tileflight.
class RunStudy : public ::testing::Test {
 protected:
  void SetUp() override { setenv("TILEFLIGHT", (made_.folder / "tileflight").c_str(), 1); }
  void TearDown() override { unsetenv("TILEFLIGHT"); }

  StudyPlan plan(const std::string& text = test_support::StudyFolder::kStudy) {
    return make_plan(read_study(made_.study(text)), folders());
  }
  PlanOptions folders() const { return {.out = made_.folder / "out", .places = {}, .jobs = 1, .cores = 2}; }
  json run(const std::string& text = test_support::StudyFolder::kStudy, bool use_snakemake = false) {
    return run_study(plan(text), folders(), {.use_snakemake = use_snakemake});
  }
  int calls() const { return tests::line_count(tests::file_text(made_.folder / "out/calls")); }

  test_support::StudyFolder made_;
};

TEST_F(RunStudy, ThePlanIsTheProductLessTheExceptions) {
  const StudyPlan whole = plan();
  EXPECT_EQ(whole.flights.size(), 3U);
  EXPECT_EQ(whole.runs.size(), 3U * 2 * 2);
  EXPECT_EQ(whole.tasks.size(), 2 + 2 * whole.runs.size() + 1);
  EXPECT_EQ(whole.runs[1].seed, whole.runs[0].seed + 1);
  const StudyPlan less =
      plan(std::string(test_support::StudyFolder::kStudy) + "except:\n  - {system: bad, flight: real}\n");
  EXPECT_EQ(less.runs.size(), 10U);
  EXPECT_THAT(plan_text(less), HasSubstr("left out: real bad"));
  const StudyPlan cameras =
      plan(std::string(test_support::StudyFolder::kStudy) + "cameras: {wide: camera.yaml, narrow: camera.yaml}\n");
  EXPECT_EQ(cameras.flights.size(), 6U);
  EXPECT_EQ(cameras.flights[0].id(), "one-wide/simulated");
}

/// Studies of the same place share its folder; whatever changes the datasets makes another.
TEST_F(RunStudy, APlacesFolderIsNamedByItsContent) {
  const std::string before = plan().flights[0].place_folder;
  EXPECT_EQ(plan("places: {one: first.yaml}\nsystems: {good: {adapter: adapters/good}}\n").flights[0].place_folder,
            before);
  test_support::write(made_.folder / "flight.yaml", "camera: camera.yaml\nfps: 3\n");
  EXPECT_NE(plan().flights[0].place_folder, before);
}

TEST_F(RunStudy, RunsEachTaskOnceAndGathersTheResults) {
  const json study = run();
  EXPECT_EQ(study["runs"].size(), 12U);
  const int first = calls();
  // Two places, twelve systems' runs, six of which are aligned and evaluated, one report.
  EXPECT_EQ(first, 2 + 12 + 6 * 2 + 1);
  run();
  EXPECT_EQ(calls(), first) << "nothing is done again";
  const json& good = study["runs"][0];
  EXPECT_EQ(good["system"], "good");
  EXPECT_EQ(good["completed"], true);
  EXPECT_EQ(good["f_score"], 0.25);
  EXPECT_EQ(good["ate_rmse"], 0.05);
  EXPECT_EQ(good["alignment_metres"], 0.01);
  EXPECT_EQ(good["cpu_seconds"], 4.5);
  EXPECT_EQ(study["ranking"][0]["system"], "good");
  EXPECT_EQ(study["ranking"][0]["score"], 0.25);
  EXPECT_EQ(study["ranking"][1]["score"], 0.0) << "a failed run is worth nothing";
  EXPECT_EQ(study["robustness"]["bad"]["failed"], 6);
  EXPECT_EQ(study["flights"][0]["site"], "one");
  ASSERT_EQ(study["differences"].size(), 1U);
  EXPECT_EQ(study["differences"][0]["better"], "good");
  EXPECT_EQ(study["differences"][0]["difference"], 0.25);
  EXPECT_EQ(study["differences"][0]["places"], 2);
  EXPECT_EQ(study["differences"][0]["real"], false) << "two places";
  EXPECT_THAT(study["warnings"].dump(), HasSubstr("1 comparison needs at least 6"));
  EXPECT_TRUE(study["survival"].empty()) << "the datasets have no true poses";
  EXPECT_TRUE(std::filesystem::exists(made_.folder / "out/study.html"));
  EXPECT_THAT(tests::file_text(made_.folder / "out/tables/ranking.csv"), HasSubstr("good,0.250"));
  EXPECT_THAT(tests::file_text(made_.folder / "out/tables/ranking.tex"), HasSubstr("\\toprule"));
  EXPECT_THAT(tests::file_text(made_.folder / "out/tables/differences.csv"), HasSubstr("good,bad,0.250"));
  EXPECT_THAT(tests::file_text(made_.folder / "out/study.html"), HasSubstr("These may be chance"));
}

/// One system has a pose for every image of the flight, the other for the first three of 36, which take 1.2 s, and then
/// crashed.
TEST_F(RunStudy, HowFarASystemCameIsReadFromItsPath) {
  const json before =
      run("places: {two: second.yaml}\nsystems: {good: {adapter: adapters/good}, bad: {adapter: adapters/bad}}\n");
  const std::filesystem::path out = made_.folder / "out";
  const std::filesystem::path dataset = out / before["runs"][0]["dataset"].get<std::string>();
  std::filesystem::remove_all(dataset);
  tests::TinyFlight::copy_to(dataset);
  geometry::Trajectory path = tests::TinyFlight::truth();
  for (const json& one : before["runs"]) {
    if (one["system"] == "bad") path.poses.resize(3);
    if (one["system"] == "bad") path.poses[2].T_local_camera.translation.x() += 1e-3;  // an estimate
    geometry::write_tum(out / one["folder"].get<std::string>() / "odometry/trajectory.txt", path);
    path = tests::TinyFlight::truth();
  }
  const json study = collect_study(out);
  const double flown_m = geometry::path_length_m(path);
  EXPECT_NEAR(study["survival"]["good"]["furthest"], flown_m, 1e-6);
  EXPECT_EQ(study["survival"]["good"]["failed"], 0);
  EXPECT_EQ(study["survival"]["bad"]["failed"], 1);
  EXPECT_LT(study["survival"]["bad"]["furthest"], 0.1 * flown_m);
  EXPECT_GT(study["survival"]["bad"]["furthest"], 0.0);
}

/// The stand-in's path is 0.05 m off, of a limit of 1 m, and lacks one of ten frames.
TEST_F(RunStudy, AFrameWithoutAPoseScoresNothing) {
  const json study = run(std::string(test_support::StudyFolder::kStudy) + "rank_by: ate\n");
  EXPECT_NEAR(study["ranking"][0]["score"], 0.9 * 0.95, 1e-12);
}

TEST_F(RunStudy, ExceptionsMustLeaveARun) {
  EXPECT_THAT(
      refusal_of([&] {
        plan("places: {one: first.yaml}\nsystems: {good: {adapter: adapters/good}}\nexcept: [{system: good}]\n");
      }),
      HasSubstr("leave nothing to run"));
}

/// A map that shrank to a point on the surface has perfect distances.
TEST_F(RunStudy, AMapInAWarningedPlaceShowsNoDistances) {
  const json before = run()["runs"][0];
  EXPECT_EQ(before["place_uncertain"], false);
  EXPECT_EQ(before["surface_median"], 0.1);
  const fs::path metrics = made_.folder / "out" / before["folder"].get<std::string>() / "metrics.json";
  json changed = json::parse(tests::file_text(metrics));
  changed["warnings"].push_back({{"message", "ambiguous"}, {"where", "alignment"}, {"severity", "note"}});
  test_support::write(metrics, changed.dump());
  EXPECT_EQ(collect_study(made_.folder / "out")["runs"][0]["surface_median"], 0.1)
      << "a note about the alignment does not count";
  changed["warnings"].push_back({{"message", "the scale is far off"}, {"where", "alignment"}, {"severity", "warning"}});
  test_support::write(metrics, changed.dump());
  const json study = collect_study(made_.folder / "out");
  const json& after = study["runs"][0];
  EXPECT_EQ(after["place_uncertain"], true);
  for (const char* key : {"surface_median", "accuracy", "completeness"}) EXPECT_TRUE(after[key].is_null()) << key;
  EXPECT_EQ(after["f_score"], before["f_score"]);
  EXPECT_THAT(study["warnings"].dump(), HasSubstr("1 of 6 maps of good may lie in a wrong place"));
  changed["doubts"] = changed["warnings"];
  changed.erase("warnings");
  test_support::write(metrics, changed.dump());
  EXPECT_THAT(refusal_of([&] { collect_study(made_.folder / "out"); }),
              HasSubstr("metrics.json: 'doubts' is called 'warnings' now"));
}

TEST_F(RunStudy, AnotherSystemLeavesWhatIsDone) {
  run("places: {one: first.yaml}\nsystems: {good: {adapter: adapters/good}}\n");
  const int before = calls();
  run("places: {one: first.yaml}\nsystems: {good: {adapter: adapters/good}, bad: {adapter: adapters/bad}}\n");
  EXPECT_EQ(calls() - before, 2 + 1) << "the new system's runs, which fail, and the report";
}

TEST_F(RunStudy, AChangedAdapterIsRunAgain) {
  const char* kStudy = "places: {two: second.yaml}\nsystems: {good: {adapter: adapters/good}}\n";
  run(kStudy);
  const int before = calls();
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  test_support::write(made_.folder / "adapters/good/run", "#!/bin/sh\n# better\n");
  run(kStudy);
  EXPECT_EQ(calls() - before, 1 + 2 + 1);
}

TEST_F(RunStudy, AFailedTaskIsNamedAndTheNextStartGoesOn) {
  std::filesystem::create_directories(made_.folder / "out");
  test_support::write(made_.folder / "out/plan.json", "{}");
  test_support::write(made_.folder / "out/fault", "");
  const std::string fault = refusal_of([&] { run(); });
  EXPECT_THAT(fault, HasSubstr("task place-one-"));
  EXPECT_THAT(fault, HasSubstr("no disk"));
  std::filesystem::remove(made_.folder / "out/fault");
  EXPECT_EQ(run()["ranking"][0]["score"], 0.25);
}

TEST_F(RunStudy, TakesNoOtherFolderAndNoBusyOne) {
  test_support::write(made_.folder / "out/mine.txt", "mine");
  EXPECT_THAT(refusal_of([&] { run(); }), HasSubstr("holds something else than a study"));
}

TEST_F(RunStudy, WithSnakemakeTheResultIsTheSame) {
  if (std::system("command -v snakemake > /dev/null") != 0) GTEST_SKIP() << "snakemake is not installed";
  const json one_by_one = run();
  std::filesystem::remove_all(made_.folder / "out");
  EXPECT_EQ(run(test_support::StudyFolder::kStudy, true), one_by_one);
  const int first = calls();
  EXPECT_EQ(first, 2 + 12 + 6 * 2 + 1);
  run(test_support::StudyFolder::kStudy, true);
  EXPECT_EQ(calls(), first) << "nothing is done again";
}

TEST_F(RunStudy, SlurmWithoutSnakemakeSaysHowToGetIt) {
  const StudyPlan made = plan();
  EXPECT_THAT(refusal_of([&] { run_study(made, folders(), {.slurm = true, .use_snakemake = false}); }),
              HasSubstr("apt-get install snakemake"));
}

}  // namespace
}  // namespace tileflight::study::run_study_test
