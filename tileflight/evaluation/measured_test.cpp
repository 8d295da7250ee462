#include "tileflight/evaluation/measured.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tileflight/evaluation/student_t.h"

namespace tileflight::evaluation {
namespace {

Measured judged(const char* name, double value, double standard_error, double margin, double degrees = 30.0) {
  Measured m{.name = name, .margin = margin};
  judge({value, standard_error, degrees}, {}, m);
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
  const Estimate sure{0.05, 0.0, 3.0}, unknown{0.05, Measured::kNaN, 3.0};
  EXPECT_EQ(sure.ci95(), (std::array{0.05, 0.05}));
  EXPECT_EQ(sure.p_within(0.1), 1.0);
  EXPECT_EQ(sure.p_beyond(0.1), 0.0);
  EXPECT_EQ(sure.p_within(0.04), 0.0);
  EXPECT_TRUE(std::isnan(unknown.ci95()[0]));
  EXPECT_TRUE(std::isnan(unknown.p_within(0.1)));
  EXPECT_NE(to_json(judged("a", 0.0, Measured::kNaN, 0.1)).dump().find("\"ci95\":[null,null]"), std::string::npos);
}

TEST(Measured, RatiosAreJudgedByTheirLogarithm) {
  Measured m{.name = "r", .scale = Scale::kRatio, .margin = 1.25};
  judge({0.02, 0.01, 20.0}, {std::log(2.0), 0.1, 20.0}, m);
  EXPECT_NEAR(m.ratio, 2.0, 1e-12);
  EXPECT_NEAR(m.ratio_ci95[0] * m.ratio_ci95[1], 4.0, 1e-12);
  EXPECT_NEAR(m.p_within, 2.0 * (1.0 - student_t_cdf(std::log(1.6) / 0.1, 20.0)), 1e-12);
  Measured inverse = m;
  judge({-0.02, 0.01, 20.0}, {-std::log(2.0), 0.1, 20.0}, inverse);
  EXPECT_NEAR(inverse.p_within, m.p_within, 1e-15);
  m.or_within = 0.05;  // as a difference they are the same
  judge({0.02, 0.01, 20.0}, {std::log(2.0), 0.1, 20.0}, m);
  EXPECT_EQ(m.p_within, 1.0);
  EXPECT_LT(m.p_beyond, 0.01);
}

TEST(Verdict, DifferentByHolmEquivalentOnlyIfAllAre) {
  std::vector<Measured> all{judged("a", 0.0, 0.01, 0.1), judged("b", 0.02, 0.01, 0.1), judged("c", 0.0, 0.01, 0.1)};
  EXPECT_EQ(verdict_on(all).word, "equivalent");
  EXPECT_EQ(verdict_on(all).on, (std::vector<std::string>{"a", "b", "c"}));
  all[1] = judged("b", 0.09, 0.01, 0.1);
  Verdict v = verdict_on(all);
  EXPECT_EQ(v.word, "undecided");
  EXPECT_EQ(v.because, std::vector<std::string>{"b"});
  // p = 0.03: different by itself, not as one of three.
  const double just = 0.1 + 0.01 * student_t_quantile(0.985, 30.0);
  all[1] = judged("b", just, 0.01, 0.1);
  EXPECT_NEAR(all[1].p_within, 0.03, 1e-9);
  EXPECT_EQ(verdict_on(all).word, "undecided");
  all[0] = judged("a", 0.3, 0.01, 0.1);
  all[2] = judged("c", -0.3, 0.01, 0.1);
  v = verdict_on(all);
  EXPECT_EQ(v.because, (std::vector<std::string>{"a", "b", "c"})) << "the last of three has all of the level";
}

TEST(Verdict, WhatDoesNotDecideIsSaidAndNotCounted) {
  std::vector<Measured> all{judged("a", 0.0, 0.01, 0.1), judged("b", 0.5, 0.01, 0.1)};
  all[1].decides = false;
  const Verdict v = verdict_on(all);
  EXPECT_EQ(v.word, "equivalent");
  EXPECT_EQ(v.on, std::vector<std::string>{"a"});
  EXPECT_EQ(all[1].verdict, "different");
}

TEST(Verdict, NothingKnownDecidesNothing) {
  std::vector<Measured> none, unknown{judged("a", 0.0, Measured::kNaN, 0.1)};
  EXPECT_EQ(verdict_on(none).word, "undecided");
  EXPECT_EQ(verdict_on(unknown).word, "undecided");
  EXPECT_EQ(verdict_on(unknown).because, std::vector<std::string>{"a"});
}

TEST(Verdict, ErrsInOneOfTwentyAtTheMarginItself) {
  // Six numbers whose true difference is the margin: the worst case for "different".
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0.0, 1.0);
  int wrong = 0;
  for (int k = 0; k < 4000; ++k) {
    std::vector<Measured> all;
    for (int m = 0; m < 6; ++m) all.push_back(judged("m", 0.1 + 0.02 * normal(random), 0.02, 0.1, 1e6));
    wrong += verdict_on(all).word == "different";
  }
  EXPECT_LE(wrong, 200);
  EXPECT_GE(wrong, 50) << "one side of each is possible only: half of the level";
}

}  // namespace
}  // namespace tileflight::evaluation
