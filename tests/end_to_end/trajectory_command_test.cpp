// `evaluate` of trajectories alone: files of each format, several at once, the page, and what it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/run_program.h"
#include "tests/test_data.h"
#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::trajectory_command_test {
namespace {

using geometry::Trajectory;
using geometry::Vec3;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using tests::file_text;
using tests::ProgramResult;
using tests::run_tileflight;

class TrajectoryCommand : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int k = 0; k < 120; ++k) {
      const double t = 0.1 * k;
      truth_.poses.push_back(
          {100.0 + t, {geometry::so3_exp({0, 0, 0.2 * t}), {t, std::sin(t), 0.2 * std::cos(2 * t)}}});
    }
    geometry::write_tum(folder_ / "truth.txt", truth_);
    geometry::write_tum(folder_ / "half.txt", transformed(geometry::Sim3(0.5, {1, 0, 0, 0}, {1, 2, 3}), truth_));
    Trajectory noisy = truth_;
    for (std::size_t i = 0; i < noisy.size(); i += 2) noisy.poses[i].T_local_camera.translation.z() += 0.1;
    geometry::write_tum(folder_ / "noisy.txt", noisy);
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }

  /// Runs `evaluate` with the truth and metrics.json in the folder `out`.
  ProgramResult evaluate(std::vector<std::string> arguments) const {
    std::filesystem::create_directories(folder_ / "out");
    std::vector<std::string> call{"evaluate", "--truth-trajectory", path("truth.txt"), "--out",
                                  path("out/metrics.json")};
    call.insert(call.end(), arguments.begin(), arguments.end());
    return run_tileflight(call);
  }
  json metrics() const { return json::parse(file_text(folder_ / "out/metrics.json")); }

  /// Exit code 2 and one line.
  static void expect_usage_fault(const ProgramResult& result, const std::string& message) {
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
    EXPECT_THAT(result.err, HasSubstr(message));
  }

  tests::TemporaryFolder folder_;
  Trajectory truth_;
};

TEST_F(TrajectoryCommand, AlignsAsAsked) {
  ASSERT_EQ(evaluate({"--trajectory", path("half.txt")}).exit_code, 0);
  json m = metrics();
  EXPECT_FALSE(m.contains("map"));
  EXPECT_LT(m["trajectory"]["ate_rmse"], 1e-9);
  EXPECT_NEAR(m["trajectory"]["scale"].get<double>(), 2.0, 1e-9);
  EXPECT_EQ(m["trajectory"]["alignment"], "sim3");
  EXPECT_EQ(m["trajectory"]["poses"], 120);
  EXPECT_TRUE(m["warnings"].empty());
  ASSERT_EQ(evaluate({"--trajectory", path("half.txt"), "--alignment", "se3"}).exit_code, 0);
  m = metrics();
  EXPECT_EQ(m["trajectory"]["scale"], 1.0);
  EXPECT_GT(m["trajectory"]["ate_rmse"], 0.5);
  EXPECT_THAT(m["warnings"].dump(), HasSubstr("the scale that fits best is 2.0")) << "said, not corrected";
  const ProgramResult none = evaluate({"--trajectory", path("noisy.txt"), "--alignment", "none"});
  ASSERT_EQ(none.exit_code, 0) << none.err;
  m = metrics()["trajectory"];
  EXPECT_NEAR(m["ate_rmse"].get<double>(), 0.1 * std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(m["ate_mean"].get<double>(), 0.05, 1e-9);
  EXPECT_NEAR(m["ate_std"].get<double>(), 0.05, 1e-9);
  EXPECT_NEAR(m["ate_max"].get<double>(), 0.1, 1e-9);
  EXPECT_NEAR(m["rpe_frames"][0]["translation_rmse_m"].get<double>(), 0.1, 1e-9);
  EXPECT_THAT(none.out, AllOf(HasSubstr("aligned by none"), HasSubstr("noisy")));
}

TEST_F(TrajectoryCommand, SeveralAtOnceWithAPage) {
  EXPECT_THAT(evaluate({"--trajectory", path("noisy.txt"), path("noisy.txt")}).err, HasSubstr("is given twice"));
  const ProgramResult both =
      evaluate({"--trajectory", path("noisy.txt"), "--trajectory", path("half.txt"), "--report"});
  ASSERT_EQ(both.exit_code, 0) << both.err;
  const json m = metrics();
  ASSERT_EQ(m["trajectories"].size(), 2u);
  EXPECT_EQ(m["trajectories"][0]["name"], "noisy");
  EXPECT_EQ(m["trajectories"][1]["name"], "half");
  EXPECT_THAT(both.out,
              AllOf(HasSubstr("noisy"), HasSubstr("half"), HasSubstr("ATE rmse m"), HasSubstr("report.html")));
  const std::string page = file_text(folder_ / "out/report.html");
  EXPECT_THAT(page, AllOf(HasSubstr("2 trajectories against the truth"), HasSubstr("figure-paths-above"),
                          HasSubstr("figure-paths-side"), HasSubstr("figure-error-over-time"),
                          HasSubstr("figure-relative-rotation")));
  std::filesystem::remove(folder_ / "out/report.html");
  EXPECT_EQ(run_tileflight({"report", path("out")}).exit_code, 0);
  EXPECT_EQ(file_text(folder_ / "out/report.html"), page) << "the same from the folder";
}

TEST_F(TrajectoryCommand, ThePageReadsTheFileThatWasAskedFor) {
  const ProgramResult scored = run_tileflight({"evaluate", "--trajectory", path("noisy.txt"), "--truth-trajectory",
                                               path("truth.txt"), "--out", path("new/deep/scores.json"), "--report"});
  ASSERT_EQ(scored.exit_code, 0) << scored.err;
  EXPECT_THAT(file_text(folder_ / "new/deep/report.html"), HasSubstr("full precision are in scores.json"));
  EXPECT_EQ(run_tileflight({"report", path("new/deep")}).exit_code, 0);
}

TEST_F(TrajectoryCommand, KittiIsPairedByLine) {
  const auto write_kitti = [&](const std::string& name, std::size_t poses) {
    std::ofstream file(folder_ / name);
    file.precision(17);
    for (std::size_t i = 0; i < poses; ++i) {
      const geometry::Mat4 T = truth_.poses[i].T_local_camera.matrix();
      for (int k = 0; k < 12; ++k) file << T(k / 4, k % 4) << (k < 11 ? " " : "\n");
    }
  };
  write_kitti("kitti.txt", 120);
  write_kitti("short.txt", 100);
  ASSERT_EQ(evaluate({"--trajectory", path("kitti.txt"), "--alignment", "none"}).exit_code, 0);
  EXPECT_LT(metrics()["trajectory"]["ate_rmse"], 1e-12);
  const ProgramResult wrong = evaluate({"--trajectory", path("short.txt")});
  EXPECT_EQ(wrong.exit_code, 1);
  EXPECT_EQ(tests::line_count(wrong.err), 1) << wrong.err;
  EXPECT_THAT(wrong.err, AllOf(HasSubstr("short.txt"), HasSubstr("has 100 poses and the truth 120")));
  EXPECT_THAT(evaluate({"--trajectory", path("kitti.txt"), "--time-offset", "1"}).err, HasSubstr("no time offset"));
}

TEST_F(TrajectoryCommand, ClocksMayDiffer) {
  Trajectory late = truth_;
  for (auto& pose : late.poses) pose.time_s += 5.03;
  geometry::write_tum(folder_ / "late.txt", late);
  ASSERT_EQ(evaluate({"--trajectory", path("late.txt"), "--time-offset", "-5.03"}).exit_code, 0);
  EXPECT_LT(metrics()["trajectory"]["ate_rmse"], 1e-9);
  EXPECT_EQ(evaluate({"--trajectory", path("late.txt"), "--time-offset=-5"}).exit_code, 1);
  ASSERT_EQ(evaluate({"--trajectory", path("late.txt"), "--time-offset=-5", "--max-time-difference", "0.04"}).exit_code,
            0);
  EXPECT_EQ(metrics()["trajectory"]["poses"], 120);
}

TEST_F(TrajectoryCommand, WrongCombinationsAreWrongUsage) {
  expect_usage_fault(evaluate({}), "give both --trajectory and --truth-trajectory");
  expect_usage_fault(evaluate({"--trajectory", path("half.txt"), "--truth", path("truth")}), "--truth: scores a map");
  expect_usage_fault(evaluate({path("map.ply"), "--trajectory", path("half.txt")}), "--truth: is required with MAP");
  const std::vector<std::string> map{path("map.ply"), "--truth", "t", "--transform", "t.json"};
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.begin(), map.begin(), map.end());
    return evaluate(more);
  };
  expect_usage_fault(with({"--report"}), "--report: is for trajectories alone");
  expect_usage_fault(with({"--alignment", "se3"}), "--alignment: is for trajectories alone");
  expect_usage_fault(with({"--trajectory", "a", "b"}), "a map has one");
  expect_usage_fault(evaluate({"--trajectory", path("half.txt"), "--alignment", "sim4"}), "sim3");
  expect_usage_fault(run_tileflight({"evaluate", "--trajectory", "a", "--out", "m.json"}), "--truth-trajectory");
}

TEST_F(TrajectoryCommand, InputsAreNotOverwritten) {
  const ProgramResult result = run_tileflight({"evaluate", "--trajectory", path("half.txt"), "--truth-trajectory",
                                               path("truth.txt"), "--out", path("half.txt")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_EQ(tests::line_count(result.err), 1) << result.err;
}

// evo's own tests compare these files: EuRoC's ground truth against a TUM file.
TEST_F(TrajectoryCommand, ReadsFilesOfEvo) {
  TILEFLIGHT_REQUIRE_TEST_DATA(evo, "trajectories/evo");
  const ProgramResult result = run_tileflight({"evaluate", "--trajectory", (evo / "V102.txt").string(),
                                               "--truth-trajectory", (evo / "V102_groundtruth.csv").string(), "--out",
                                               path("metrics.json"), "--alignment", "se3", "--json"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const json m = json::parse(result.out)["trajectory"];
  EXPECT_GT(m["poses"], 700);
  EXPECT_LT(m["ate_rmse"], 0.2);
}

}  // namespace
}  // namespace tileflight::trajectory_command_test
