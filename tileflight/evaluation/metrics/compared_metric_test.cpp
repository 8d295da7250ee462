#include "tileflight/evaluation/metrics/compared_metric.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <random>

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
