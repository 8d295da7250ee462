#include "tileflight/evaluation/metrics/compared_metric.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics::compared_metric_test {
namespace {

ComparedMetric judged(const char* name, double value, double standard_error, double margin, double degrees = 30.0) {
  ComparedMetric m{.name = name, .margin = margin};
  judge_equivalence({value, standard_error, degrees}, {}, m);
  return m;
}

TEST(Measured, IntervalAndTestsSayTheSame) {
  for (const double value : {-0.3, -0.11, -0.1, 0.0, 0.02, 0.09, 0.1, 0.15, 0.4}) {
    for (const double error : {0.001, 0.02, 0.05, 0.2}) {
      const Estimate e{value, error, 12.0};
      const auto ci95 = e.ci95();
      const double half90 = error * student_t_quantile(0.95, 12.0);
      EXPECT_EQ(e.p_within(0.1) <= 0.05, ci95[0] >= 0.1 || ci95[1] <= -0.1) << value << " " << error;
      EXPECT_EQ(e.p_beyond(0.1) <= 0.05, value - half90 >= -0.1 && value + half90 <= 0.1) << value << " " << error;
    }
  }
}

TEST(Measured, WithoutErrorOrWithoutKnowingIt) {
  const Estimate sure{0.05, 0.0, 3.0}, unknown{0.05, ComparedMetric::kNaN, 3.0};
  EXPECT_EQ(sure.ci95(), (std::array{0.05, 0.05}));
  EXPECT_EQ(sure.p_within(0.1), 1.0);
  EXPECT_EQ(sure.p_beyond(0.1), 0.0);
  EXPECT_EQ(sure.p_within(0.04), 0.0);
  EXPECT_TRUE(std::isnan(unknown.ci95()[0]));
  EXPECT_TRUE(std::isnan(unknown.p_within(0.1)));
  EXPECT_NE(to_json(judged("a", 0.0, ComparedMetric::kNaN, 0.1)).dump().find("\"ci95\":[null,null]"),
            std::string::npos);
}

TEST(Measured, RatiosAreJudgedByTheirLogarithm) {
  ComparedMetric m{.name = "r", .scale = MarginScale::kRatio, .margin = 1.25};
  judge_equivalence({0.02, 0.01, 20.0}, {std::log(2.0), 0.1, 20.0}, m);
  EXPECT_NEAR(m.ratio, 2.0, 1e-12);
  EXPECT_NEAR(m.ratio_ci95[0] * m.ratio_ci95[1], 4.0, 1e-12);
  EXPECT_NEAR(m.p_within, 2.0 * (1.0 - student_t_cdf(std::log(1.6) / 0.1, 20.0)), 1e-12);
  ComparedMetric inverse = m;
  judge_equivalence({-0.02, 0.01, 20.0}, {-std::log(2.0), 0.1, 20.0}, inverse);
  EXPECT_NEAR(inverse.p_within, m.p_within, 1e-15);
  m.absolute_margin = 0.05;  // equivalent by the difference
  judge_equivalence({0.02, 0.01, 20.0}, {std::log(2.0), 0.1, 20.0}, m);
  EXPECT_EQ(m.p_within, 1.0);
  EXPECT_LT(m.p_beyond, 0.01);
}

TEST(Verdict, DifferentByHolmEquivalentOnlyIfAllAre) {
  std::vector<ComparedMetric> all{judged("a", 0.0, 0.01, 0.1), judged("b", 0.02, 0.01, 0.1),
                                  judged("c", 0.0, 0.01, 0.1)};
  EXPECT_EQ(decide_verdict(all).word, "equivalent");
  EXPECT_EQ(decide_verdict(all).decisive_metrics, (std::vector<std::string>{"a", "b", "c"}));
  all[1] = judged("b", 0.09, 0.01, 0.1);
  Verdict v = decide_verdict(all);
  EXPECT_EQ(v.word, "undecided");
  EXPECT_EQ(v.reasons, std::vector<std::string>{"b"});
  // p = 0.03: different by itself, not as one of three.
  const double just = 0.1 + 0.01 * student_t_quantile(0.985, 30.0);
  all[1] = judged("b", just, 0.01, 0.1);
  EXPECT_NEAR(all[1].p_within, 0.03, 1e-9);
  EXPECT_EQ(decide_verdict(all).word, "undecided");
  all[0] = judged("a", 0.3, 0.01, 0.1);
  all[2] = judged("c", -0.3, 0.01, 0.1);
  v = decide_verdict(all);
  EXPECT_EQ(v.reasons, (std::vector<std::string>{"a", "b", "c"})) << "the last of three has all of the level";
}

TEST(Verdict, WhatDoesNotDecideIsSaidAndNotCounted) {
  std::vector<ComparedMetric> all{judged("a", 0.0, 0.01, 0.1), judged("b", 0.5, 0.01, 0.1)};
  all[1].is_decisive = false;
  const Verdict v = decide_verdict(all);
  EXPECT_EQ(v.word, "equivalent");
  EXPECT_EQ(v.decisive_metrics, std::vector<std::string>{"a"});
  EXPECT_EQ(all[1].verdict, "different");
}

TEST(Verdict, NothingKnownDecidesNothing) {
  std::vector<ComparedMetric> none, unknown{judged("a", 0.0, ComparedMetric::kNaN, 0.1)};
  EXPECT_EQ(decide_verdict(none).word, "undecided");
  EXPECT_EQ(decide_verdict(unknown).word, "undecided");
  EXPECT_EQ(decide_verdict(unknown).reasons, std::vector<std::string>{"a"});
}

TEST(Verdict, ErrsInOneOfTwentyAtTheMarginItself) {
  // Six metrics whose true difference equals the margin: the worst case for "different".
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  int wrong = 0;
  for (int k = 0; k < 4000; ++k) {
    std::vector<ComparedMetric> all;
    for (int m = 0; m < 6; ++m) all.push_back(judged("m", 0.1 + 0.02 * normal(random), 0.02, 0.1, 1e6));
    wrong += decide_verdict(all).word == "different";
  }
  EXPECT_LE(wrong, 200);
  EXPECT_GE(wrong, 50) << "one side of each is possible only: half of the level";
}

}  // namespace
}  // namespace tileflight::metrics::compared_metric_test

namespace tileflight::metrics::path_comparison_test {
namespace {

using geometry::Vec3;

ComparedMetric judged(double simulated_m, double real_m) {
  ComparedMetric m{.name = "path.ate", .scale = MarginScale::kRatio, .margin = 1.25, .absolute_margin = 0.1};
  judge_single_paths(simulated_m, real_m, m);
  return m;
}

TEST(PathComparison, IntervalsAreFishersAndHoldTheValue) {
  const ComparedMetric m = judged(0.3, 0.2);
  EXPECT_NEAR(m.ratio, 1.5, 1e-12);
  EXPECT_NEAR(m.ratio_ci95[1], 1.5 * std::sqrt(39.0), 1e-9) << "F(2, 2) at 0.975 is 39";
  EXPECT_NEAR(m.ratio_ci95[0], 1.5 / std::sqrt(39.0), 1e-9);
  EXPECT_LT(m.difference_ci95[0], 0.1);
  EXPECT_GT(m.difference_ci95[1], 0.1);
  const ComparedMetric other = judged(0.2, 0.3);
  EXPECT_NEAR(other.difference_ci95[0], -m.difference_ci95[1], 1e-12);
  EXPECT_EQ(m.sampling_unit, "one path");
}

TEST(PathComparison, TestsFollowTheIntervals) {
  EXPECT_LE(judged(0.01, 0.012).p_beyond, 0.05) << "both far below the margin of 0.1 m";
  EXPECT_GT(judged(0.01, 0.08).p_beyond, 0.05);
  EXPECT_GT(judged(0.4, 0.5).p_beyond, 0.05) << "one path each never shows a ratio within 1.25";
  EXPECT_LE(judged(20.0, 0.05).p_within, 0.05);
  EXPECT_GT(judged(1.0, 0.3).p_within, 0.05);
  EXPECT_EQ(judged(0.05, 0.001).p_within, 1.0);
  for (const double ratio : {1.5, 5.0, 9.0, 15.0, 40.0}) {
    const ComparedMetric m = judged(10.0 * ratio, 10.0);  // the difference is far beyond 0.1 m; the ratio decides
    EXPECT_EQ(m.p_within <= 0.05, m.ratio_ci95[0] >= 1.25 && m.difference_ci95[0] >= 0.1) << ratio;
  }
}

TEST(PathComparison, WithoutAnErrorThereIsNothingToSay) {
  EXPECT_TRUE(std::isnan(judged(0.0, 0.1).p_within));
  EXPECT_TRUE(std::isnan(judged(0.1, 0.0).ratio));
}

// ---------------------------------------------------------------------------------- paths that drift, and what is said

/// Three independent standard normal values.
Vec3 normal_vector(std::mt19937_64& random) {
  std::normal_distribution<double> normal(0.0, 1.0);
  return {normal(random), normal(random), normal(random)};
}

/// A path with random-walk drift of direction, scale and position.
geometry::Trajectory drifted(const geometry::Trajectory& truth, double turn_rad, double scale, double step_m,
                             std::mt19937_64& random) {
  geometry::Trajectory path = truth;
  Vec3 turn = Vec3::Zero();
  double log_scale = 0.0;
  for (std::size_t i = 1; i < truth.size(); ++i) {
    turn += turn_rad * normal_vector(random);
    log_scale += scale * normal_vector(random).x();
    const Vec3 step = truth.poses[i].T_local_camera.translation - truth.poses[i - 1].T_local_camera.translation;
    path.poses[i].T_local_camera.translation = path.poses[i - 1].T_local_camera.translation +
                                               std::exp(log_scale) * (step + turn.cross(step)) +
                                               step_m * normal_vector(random);
  }
  return path;
}

geometry::Trajectory flown(const std::function<Vec3(double)>& at) {
  geometry::Trajectory path;
  constexpr int kPoses = 150;
  for (int i = 0; i <= kPoses; ++i) path.poses.push_back({0.2 * i, {geometry::SE3().rotation, at(1.0 * i / kPoses)}});
  return path;
}

TEST(PathComparison, IntervalsHoldTheRatioOfDriftsAtLeastAsOftenAsTheySay) {
  const std::vector<geometry::Trajectory> paths{flown([](double t) -> Vec3 {
                                                  return {200 * t, 30 * std::sin(4 * t), 40 + 10 * std::sin(3 * t)};
                                                }),
                                                flown([](double t) -> Vec3 {
                                                  return {60 * std::cos(6.28 * t), 60 * std::sin(6.28 * t), 40};
                                                }),
                                                flown([](double t) -> Vec3 {
                                                  return {60 * std::sin(25.1 * t), 120 * t, 40};
                                                })};
  struct Drift {
    double turn_rad, scale, step_m;
  };
  std::mt19937_64 random(3);
  for (const auto& truth : paths) {
    for (const Drift& d : {Drift{3e-4, 0, 0}, Drift{0, 1.5e-3, 0}, Drift{0, 0, 0.02}, Drift{2e-4, 7e-4, 0.006}}) {
      int held = 0;
      constexpr int kPairs = 200;
      for (int k = 0; k < kPairs; ++k) {
        const auto ate_m = [&](double times) {
          return evaluate_trajectory(drifted(truth, times * d.turn_rad, times * d.scale, times * d.step_m, random),
                                     truth, {.alignment = TrajectoryAlignment::kSim3})
              .ate_rmse_m;
        };
        const ComparedMetric m = judged(ate_m(2.0), ate_m(1.0));  // the true ratio is 2
        held += m.ratio_ci95[0] <= 2.0 && 2.0 <= m.ratio_ci95[1];
      }
      EXPECT_GE(held, 188) << d.turn_rad << " " << d.scale << " " << d.step_m;
    }
  }
}

}  // namespace
}  // namespace tileflight::metrics::path_comparison_test
