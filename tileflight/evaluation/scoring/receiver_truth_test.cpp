#include "tileflight/evaluation/scoring/receiver_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/evaluation/scoring/evaluate_trajectories.h"

namespace tileflight::scoring::receiver_truth_test {
namespace {

using geometry::Vec3;
using testing::HasSubstr;
using testing::Not;

/// A flight of 60 s whose camera turns; its estimate is in another frame, 0.4 times as large.
class AgainstAReceiver : public testing::Test {
 protected:
  static geometry::SE3 camera_at(double t) {
    const Vec3 position(40.0 * std::sin(0.11 * t), 25.0 * std::sin(0.23 * t + 0.3), 20.0 + 3.0 * std::sin(0.31 * t));
    return {Eigen::Quaterniond(geometry::so3_exp({0.4 * std::sin(0.5 * t), 0.3, 0.15 * t})), position};
  }

  void SetUp() override {
    const geometry::Sim3 T_map_local{0.4, Eigen::Quaterniond(geometry::so3_exp({0.3, -0.2, 1.0})), Vec3(5, -3, 2)};
    geometry::Trajectory local;
    for (int i = 0; i <= 600; ++i) local.poses.push_back({0.1 * i, camera_at(0.1 * i)});
    geometry::write_tum(folder_ / "estimate.txt", geometry::transformed(T_map_local, local));
  }

  /// The antenna's positions each 0.2 s, as a table; `clock_s` is what the receiver's clock is ahead.
  void write_log(const Vec3& lever_arm, double clock_s, double noise_h_m = 0.0, double noise_v_m = 0.0) const {
    const geometry::LocalFrame frame({47.1, 8.2, {500.0}});
    std::mt19937_64 random(7);
    std::normal_distribution<double> normal;
    std::string text = "time (s),latitude,longitude,altitude (m),speed,heading,satellites,voltage\n";
    for (int i = 2; i < 298; ++i) {
      const double t = 0.2 * i;
      const geometry::SE3 camera = camera_at(t);
      Vec3 antenna = camera.translation + camera.rotation * lever_arm;
      antenna += Vec3(noise_h_m * normal(random), noise_h_m * normal(random), noise_v_m * normal(random));
      const geometry::Geodetic place = frame.geodetic_from_local(antenna);
      text += base::formatted("%.2f,%.10f,%.10f,%.5f,1,2,3,4\n", t + clock_s, place.latitude_deg, place.longitude_deg,
                              place.height.m);
    }
    base::write_file(folder_ / "log.csv", text);
  }

  nlohmann::json evaluate(std::optional<double> time_offset_s = 0.0, const Vec3& lever_arm = Vec3::Zero()) const {
    return evaluate_trajectories({.estimates = {folder_ / "estimate.txt"},
                                  .truth = folder_ / "log.csv",
                                  .options = {},
                                  .time_offset_s = time_offset_s,
                                  .lever_arm_m = lever_arm},
                                 folder_ / "m.json");
  }

  tests::TemporaryFolder folder_;
};

TEST_F(AgainstAReceiver, ExactPositionsLeaveNoError) {
  write_log(Vec3::Zero(), 0.0);
  const nlohmann::json m = evaluate()["trajectory"];
  EXPECT_EQ(m["poses"], 296);
  EXPECT_NEAR(m["scale"], 2.5, 0.002);
  EXPECT_LT(m["ate_rmse"], 0.02);  // positions between poses are interpolated along straight lines
  EXPECT_TRUE(m["rpe_frames"][0]["rotation_rmse_deg"].is_null());
  EXPECT_NEAR(m["receiver"]["expected_rmse_m"], std::sqrt(6.0), 1e-9);  // a log that states none: 1 m, 1 m and 2 m
  EXPECT_TRUE(m["receiver"]["beyond_receiver_m"].is_null());
}

/// Straight lines over the missing poses would be off by metres.
TEST_F(AgainstAReceiver, PositionsBetweenDistantPosesAreLeftOut) {
  write_log(Vec3::Zero(), 0.0);
  geometry::Trajectory every_2_s, whole = geometry::read_tum(folder_ / "estimate.txt");
  for (std::size_t i = 0; i < whole.size(); i += 20) {
    if (i % 100 != 40) every_2_s.poses.push_back(whole.poses[i]);
  }
  geometry::write_tum(folder_ / "estimate.txt", every_2_s);
  const nlohmann::json m = evaluate();
  EXPECT_EQ(m["trajectory"]["poses"], 23);
  EXPECT_LT(m["trajectory"]["ate_rmse"], 0.001);
  EXPECT_THAT(m["warnings"].dump(), Not(HasSubstr("taken as straight")));
}

TEST_F(AgainstAReceiver, ItIsSaidThatBendsBetweenDistantPosesAreInTheError) {
  write_log(Vec3::Zero(), 0.0);
  geometry::Trajectory every_2_s, whole = geometry::read_tum(folder_ / "estimate.txt");
  for (std::size_t i = 1; i < whole.size(); i += 20) every_2_s.poses.push_back(whole.poses[i]);
  geometry::write_tum(folder_ / "estimate.txt", every_2_s);
  const nlohmann::json m = evaluate();
  EXPECT_GT(m["trajectory"]["ate_rmse"], 0.1);
  EXPECT_THAT(m["warnings"].dump(), HasSubstr("poses up to 2.0 s apart"));
}

TEST_F(AgainstAReceiver, TheAntennaIsNotTheCamera) {
  const Vec3 lever_arm(0.5, -1.5, 0.8);
  write_log(lever_arm, 0.0);
  EXPECT_GT(evaluate()["trajectory"]["ate_rmse"], 0.3);
  const nlohmann::json m = evaluate(0.0, lever_arm)["trajectory"];
  EXPECT_LT(m["ate_rmse"], 0.02);
  EXPECT_NEAR(m["scale"], 2.5, 0.002);
}

TEST_F(AgainstAReceiver, AnotherClockIsFoundOrNamed) {
  write_log(Vec3::Zero(), 31.3);
  const nlohmann::json found = evaluate(std::nullopt)["trajectory"];
  EXPECT_NEAR(found["receiver"]["time_offset_s"], 31.3, 0.02);
  EXPECT_LT(found["ate_rmse"], 0.1);
  EXPECT_LT(evaluate(31.3)["trajectory"]["ate_rmse"], 0.02);
  const nlohmann::json late = evaluate(30.9);
  EXPECT_THAT(late["warnings"].dump(), HasSubstr("--time-offset 31.3"));
  EXPECT_THAT(
      tests::refusal_of([&] { (void)evaluate(100.0); }),
      HasSubstr("0 of the receiver's 296 positions lie within its times (100.000 to 160.000 s, the receiver's "));
}

TEST_F(AgainstAReceiver, TheReceiversOwnErrorIsToldApart) {
  write_log(Vec3::Zero(), 0.0, 1.0, 2.0);
  const nlohmann::json as_stated = evaluate()["trajectory"]["receiver"];
  EXPECT_NEAR(as_stated["normalized_error_squared"], 1.0, 0.15);
  write_log(Vec3::Zero(), 0.0, 3.0, 6.0);
  const nlohmann::json worse = evaluate();
  EXPECT_NEAR(worse["trajectory"]["receiver"]["beyond_receiver_m"], std::sqrt(8.0 * 6.0), 0.7);
  EXPECT_THAT(worse["warnings"].dump(), HasSubstr("m are beyond that"));
  EXPECT_THAT(worse["warnings"].dump(), HasSubstr("2 m (height; assumed, the log states none)"));
}

TEST_F(AgainstAReceiver, ADatasetsPositionsServeWhereItHasNoTruePoses) {
  EXPECT_FALSE(read_receiver_truth(folder_ / "estimate.txt"));  // poses
  write_log(Vec3::Zero(), 0.0);
  EXPECT_TRUE(read_receiver_truth(folder_ / "log.csv"));
}

TEST_F(AgainstAReceiver, WhatCannotBeComparedIsRefused) {
  write_log(Vec3::Zero(), 0.0);
  base::write_file(folder_ / "kitti.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n");
  const auto score = [&](const char* estimate, const char* truth, metrics::TrajectoryAlignment alignment) {
    return tests::refusal_of([&] {
      (void)evaluate_trajectories(
          {.estimates = {folder_ / estimate}, .truth = folder_ / truth, .options = {.alignment = alignment}},
          folder_ / "m.json");
    });
  };
  EXPECT_THAT(score("kitti.txt", "log.csv", metrics::TrajectoryAlignment::kSim3), HasSubstr("have no times"));
  EXPECT_THAT(score("estimate.txt", "log.csv", metrics::TrajectoryAlignment::kNone), HasSubstr("use sim3 or se3"));
  base::write_file(folder_ / "short.csv", "time,latitude,longitude,altitude\n1,47,8,500\n2,47.0001,8,500\n");
  EXPECT_THAT(score("estimate.txt", "short.csv", metrics::TrajectoryAlignment::kSim3),
              HasSubstr("is compared with 2 positions of a receiver"));
  EXPECT_THAT(tests::refusal_of([&] {
                (void)evaluate_trajectories({.estimates = {folder_ / "estimate.txt"},
                                             .truth = folder_ / "estimate.txt",
                                             .options = {},
                                             .time_offset_s = std::nullopt},
                                            folder_ / "m.json");
              }),
              HasSubstr("auto needs a receiver's positions"));
}

TEST_F(AgainstAReceiver, PositionsLocatedInTheTilesAreAReferenceWithTheirOwnSigmas) {
  geometry::Trajectory located;
  std::string quality = "frame,time_s,source,sigma_east_m,sigma_north_m,sigma_up_m\n";
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  for (int i = 0; i <= 300; ++i) {
    geometry::SE3 pose = camera_at(0.2 * i);
    pose.translation += Vec3(0.05 * normal(random), 0.05 * normal(random), 0.1 * normal(random));
    quality += base::formatted("%06d,%.3f,%s,0.05,0.05,0.1\n", i, 0.2 * i, i == 7 ? "lost" : "place");
    if (i != 7) located.poses.push_back({0.2 * i, pose});
  }
  std::filesystem::create_directories(folder_ / "located");
  geometry::write_tum(folder_ / "located/trajectory.txt", located);
  base::write_file(folder_ / "located/quality.csv", quality);
  base::write_file(folder_ / "located/localize.json", "{}");
  const nlohmann::json metrics = evaluate_trajectories({.estimates = {folder_ / "estimate.txt"},
                                                        .truth = folder_ / "located",
                                                        .options = {},
                                                        .time_offset_s = 0.0,
                                                        .lever_arm_m = Vec3::Zero()},
                                                       folder_ / "located.json");
  const nlohmann::json& trajectory = metrics.at("trajectory");
  EXPECT_EQ(trajectory.at("poses"), 300);
  EXPECT_NEAR(trajectory.at("ate_rmse"), std::sqrt(2 * 0.05 * 0.05 + 0.1 * 0.1), 0.01);
  EXPECT_NEAR(trajectory.at("receiver").at("normalized_error_squared"), 1.0, 0.15);
  EXPECT_THAT(metrics.at("warnings").dump(), HasSubstr("positions located in the tiles with standard deviations"));
  base::write_file(folder_ / "located/quality.csv", "frame,time_s\n000000,x\n");
  EXPECT_THAT(tests::refusal_of([&] { read_receiver_truth(folder_ / "located"); }),
              HasSubstr("quality.csv, line 2: has no number in the column time_s"));
}

}  // namespace
}  // namespace tileflight::scoring::receiver_truth_test
