#include "tileflight/evaluation/metrics/repeated_runs.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics::repeated_runs_test {
namespace {

const double kPi = std::acos(-1.0);

// ------------------------------------------------------------------------------------------------ Student's t

TEST(StudentT, OneDegreeIsCauchyTwoHaveAClosedFormManyAreNormal) {
  for (const double t : {-30.0, -2.0, -0.3, 0.0, 0.7, 1.0, 5.0, 400.0}) {
    EXPECT_NEAR(student_t_cdf(t, 1), 0.5 + std::atan(t) / kPi, 1e-14) << t;
    EXPECT_NEAR(student_t_cdf(t, 2), 0.5 + t / (2 * std::sqrt(2 + t * t)), 1e-14) << t;
    EXPECT_NEAR(student_t_cdf(t, 1e7), 0.5 * std::erfc(-t / std::sqrt(2.0)), 1e-7) << t;
  }
}

TEST(StudentT, DistributionIsTheIntegralOfTheDensity) {
  for (const double degrees : {2.5, 3.0, 7.3, 40.0}) {
    const double scale = std::exp(std::lgamma((degrees + 1) / 2) - std::lgamma(degrees / 2)) / std::sqrt(degrees * kPi);
    constexpr int kSteps = 20000;
    constexpr double kEnd = 2.7;
    double area = 0.0;
    for (int k = 0; k < kSteps; ++k) {
      const double t = kEnd * (k + 0.5) / kSteps;
      area += scale * std::pow(1 + t * t / degrees, -(degrees + 1) / 2) * kEnd / kSteps;
    }
    EXPECT_NEAR(student_t_cdf(kEnd, degrees) - 0.5, area, 1e-8) << degrees;
  }
}

TEST(StudentT, QuantilesAreThoseOfTheTables) {
  // Printed tables, two-sided 95 %.
  EXPECT_NEAR(student_t_quantile(0.975, 1), 12.706, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 2), 4.303, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 4), 2.776, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.975, 9), 2.262, 5e-4);
  EXPECT_NEAR(student_t_quantile(0.95, 30), 1.697, 5e-4);
  for (const double p : {0.001, 0.2, 0.5, 0.77, 0.999})
    EXPECT_NEAR(student_t_cdf(student_t_quantile(p, 3.7), 3.7), p, 1e-12);
}

// ------------------------------------------------------------------------------------------------ spread

TEST(RunSpread, ClosedForm) {
  const RunSpread s = compute_run_spread({1.0, 2.0, 4.0, 5.0});
  EXPECT_EQ(s.runs, 4u);
  EXPECT_DOUBLE_EQ(s.mean, 3.0);
  EXPECT_DOUBLE_EQ(s.std, std::sqrt(10.0 / 3.0));
  EXPECT_DOUBLE_EQ(s.min, 1.0);
  EXPECT_DOUBLE_EQ(s.max, 5.0);
  EXPECT_NEAR(s.ci95[1] - s.mean, 3.182446 * s.std / 2.0, 1e-5);
  EXPECT_NEAR(s.mean - s.ci95[0], s.ci95[1] - s.mean, 1e-12);
}

TEST(RunSpread, RunsThatDoNotDifferAreNoSample) {
  for (const auto& values : {std::vector<double>{}, {0.3}, {0.1, 0.1, 0.1}}) {
    const RunSpread s = compute_run_spread(values);
    EXPECT_EQ(s.runs, values.size());
    EXPECT_TRUE(std::isnan(s.ci95[0]) && std::isnan(s.ci95[1]));
  }
  EXPECT_EQ(compute_run_spread({0.1, 0.1, 0.1}).std, 0.0);
  EXPECT_EQ(compute_run_spread({0.3, std::numeric_limits<double>::quiet_NaN()}).runs, 1u) << "a run without the number";
  EXPECT_NE(to_json(compute_run_spread({0.3})).dump().find("\"ci95\":[null,null]"), std::string::npos);
}

TEST(RunDifference, EqualSpreadsAndNumbersAreTheTextbookCase) {
  // Equal n and equal variances: Welch's degrees of freedom are 2n - 2, as for the pooled test.
  const RunDifference d = welch_difference({1, 2, 3, 4, 5}, {11, 12, 13, 14, 15});
  EXPECT_DOUBLE_EQ(d.difference, -10.0);
  EXPECT_NEAR(d.degrees_of_freedom, 8.0, 1e-12);
  EXPECT_NEAR(d.ci95[1] + 10.0, 2.306004 * std::sqrt(2.5 / 5 + 2.5 / 5), 1e-5);
  EXPECT_NEAR(d.ci90[1] + 10.0, 1.859548 * std::sqrt(2.5 / 5 + 2.5 / 5), 1e-5);
}

TEST(RunDifference, OneSideThatNeverChangesLeavesTheOthersDegrees) {
  const RunDifference d = welch_difference({1, 2, 4}, {3, 3, 3, 3});
  EXPECT_TRUE(d.has_interval());
  EXPECT_NEAR(d.degrees_of_freedom, 2.0, 1e-12);
  EXPECT_FALSE(welch_difference({1, 1}, {2, 2}).has_interval());
  EXPECT_FALSE(welch_difference({1}, {2, 3}).has_interval());
  EXPECT_FALSE(welch_difference({}, {}).has_interval());
}

TEST(RunSpread, OfEveryNumberOfSeveralObjects) {
  using nlohmann::json;
  const std::vector<json> runs{
      json::parse(R"({"map": {"mean": 1.0, "points": 10, "edges": [1, 2], "truth": "v"}, "x": 5})"),
      json::parse(R"({"map": {"mean": 3.0, "points": 12, "edges": [1, 2], "truth": "v"}, "x": null})"),
      json::parse(R"({"map": {"mean": 2.0, "points": 20, "edges": [1, 2], "truth": "v"}})")};
  const json tree = compute_json_spread(runs);
  EXPECT_EQ(tree["map"].size(), 2u) << "no lists, no text: " << tree;
  EXPECT_EQ(tree["map"]["mean"], to_json(compute_run_spread({1.0, 3.0, 2.0})));
  EXPECT_EQ(tree["map"]["points"]["mean"], 14.0);
  EXPECT_EQ(tree["x"]["n"], 1);
  EXPECT_TRUE(compute_json_spread({}).empty());
}

// ------------------------------------------------------------------------------------------------ coverage

/// Number of intervals that contain the truth, of 1000 experiments.
template <class Interval>
int covered(double truth, const Interval& interval) {
  int count = 0;
  for (int k = 0; k < 1000; ++k) {
    const std::array<double, 2> ci = interval();
    count += ci[0] <= truth && truth <= ci[1];
  }
  return count;
}

TEST(RunSpread, IntervalCoversTheMeanAsOftenAsItSays) {
  std::mt19937_64 random(1);
  std::normal_distribution<double> value(0.55, 0.03);
  for (const int runs : {2, 3, 5, 10}) {
    const int held = covered(0.55, [&] {
      std::vector<double> values;
      for (int k = 0; k < runs; ++k) values.push_back(value(random));
      return compute_run_spread(values).ci95;
    });
    EXPECT_GE(held, 930) << runs;
    EXPECT_LE(held, 970) << runs;
  }
}

TEST(RunDifference, IntervalCoversTheDifferenceAsOftenAsItSays) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> simulated(0.55, 0.01), real(0.58, 0.03);
  for (const auto& [n_simulated, n_real] : {std::pair{5, 5}, {3, 8}, {10, 4}}) {
    const int held = covered(-0.03, [&, a_runs = n_simulated, b_runs = n_real] {
      std::vector<double> a, b;
      for (int k = 0; k < a_runs; ++k) a.push_back(simulated(random));
      for (int k = 0; k < b_runs; ++k) b.push_back(real(random));
      return welch_difference(a, b).ci95;
    });
    EXPECT_GE(held, 930) << n_simulated << " and " << n_real;
    EXPECT_LE(held, 970) << n_simulated << " and " << n_real;
  }
}

}  // namespace
}  // namespace tileflight::metrics::repeated_runs_test
