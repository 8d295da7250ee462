#include "tileflight/experiments/study/run_survival.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace tileflight::study::run_survival_test {
namespace {

using geometry::SE3;
using geometry::Trajectory;
using geometry::Vec3;

/// A curved flight of 101 poses in 10 s, about 100 m; `change` maps its index and position.
Trajectory flight(const std::function<Vec3(int, const Vec3&)>& change = {}) {
  Trajectory path;
  for (int i = 0; i <= 100; ++i) {
    const Vec3 at(i, 5.0 * std::sin(0.1 * i), 0.02 * i);
    path.poses.push_back({0.1 * i, SE3(Eigen::Quaterniond::Identity(), change ? change(i, at) : at)});
  }
  return path;
}

Trajectory without(Trajectory path, int from, int to) {
  path.poses.erase(path.poses.begin() + from, path.poses.begin() + to);
  return path;
}

TEST(MeasureSurvival, AWholePathOfAnyScaleReachesTheEnd) {
  const RunSurvival whole = measure_survival(flight([](int, const Vec3& p) { return Vec3(0.2 * p); }), flight());
  EXPECT_FALSE(whole.failed) << whole.reason;
  EXPECT_NEAR(whole.distance_m, geometry::path_length_m(flight()), 1e-9);
}

TEST(MeasureSurvival, ALateStartIsNoFailureAndAnEarlyEndIs) {
  EXPECT_FALSE(measure_survival(without(flight(), 0, 40), flight()).failed);
  const RunSurvival early = measure_survival(without(flight(), 61, 101), flight());
  EXPECT_TRUE(early.failed);
  EXPECT_NEAR(early.distance_m, geometry::path_length_m(without(flight(), 61, 101)), 1e-9);
  EXPECT_FALSE(measure_survival(without(flight(), 95, 101), flight()).failed) << "half a second";
}

TEST(MeasureSurvival, AGapOfMoreThanASecondIsAFailure) {
  EXPECT_FALSE(measure_survival(without(flight(), 50, 58), flight()).failed);
  const RunSurvival gap = measure_survival(without(flight(), 50, 65), flight());
  EXPECT_TRUE(gap.failed);
  EXPECT_NEAR(gap.distance_m, geometry::path_length_m(without(flight(), 50, 101)), 1e-9);
}

/// Photos every two seconds have no gap.
TEST(MeasureSurvival, StepsOfSlowFlightsAreNoGaps) {
  Trajectory photos = flight();
  for (geometry::StampedPose& pose : photos.poses) pose.time_s *= 20.0;
  EXPECT_FALSE(measure_survival(photos, photos).failed);
}

TEST(MeasureSurvival, AJumpIsAFailureWhereItsStretchBegins) {
  const RunSurvival jump =
      measure_survival(flight([](int i, const Vec3& p) { return Vec3(p + Vec3(0, 0, i < 55 ? 0 : 20)); }), flight());
  EXPECT_TRUE(jump.failed);
  EXPECT_LT(jump.distance_m, 57.0 * 1.2);
  EXPECT_GT(jump.distance_m, 40.0);
}

TEST(MeasureSurvival, AScaleThatChangesIsAFailureAndASlowDriftOfPositionIsNot) {
  const auto scaled = [](double factor) {
    return flight([factor](int i, const Vec3& p) {
      const double x = i < 50 ? p.x() : 50.0 + factor * (p.x() - 50.0);
      return Vec3(x, i < 50 ? p.y() : factor * p.y(), p.z());
    });
  };
  EXPECT_TRUE(measure_survival(scaled(0.5), flight()).failed);
  EXPECT_FALSE(measure_survival(scaled(0.9), flight()).failed);
}

TEST(MeasureSurvival, AFlightThatStandsStillHasNoStretchesToBreak) {
  const Trajectory still = flight([](int, const Vec3&) { return Vec3(1, 2, 3); });
  const RunSurvival hover = measure_survival(flight(), still);
  EXPECT_FALSE(hover.failed);
  EXPECT_EQ(hover.distance_m, 0.0);
}

TEST(MeasureSurvival, WithoutPosesOrWithoutMotionItFailsAtTheStart) {
  EXPECT_EQ(measure_survival({}, flight()).distance_m, 0.0);
  EXPECT_TRUE(measure_survival({}, flight()).failed);
  const RunSurvival still = measure_survival(flight([](int, const Vec3&) { return Vec3(1, 2, 3); }), flight());
  EXPECT_TRUE(still.failed);
  EXPECT_EQ(still.distance_m, 0.0);
}

/// Times of remission under 6-mercaptopurine (Freireich et al., Blood 21, 1963), with the estimate that textbooks
/// print.
TEST(SurvivalCurve, IsThatOfTheTextbook) {
  std::vector<RunSurvival> patients;
  for (const double weeks : {6, 6, 6, 7, 10, 13, 16, 22, 23}) patients.push_back({weeks, true, {}});
  for (const double weeks : {6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35}) patients.push_back({weeks, false, {}});
  const std::vector<SurvivalStep> curve = survival_curve(patients);
  ASSERT_EQ(curve.size(), 7U);
  const std::vector<double> share{0.8571, 0.8067, 0.7529, 0.6902, 0.6275, 0.5378, 0.4482};
  const std::vector<std::size_t> at_risk{21, 17, 15, 12, 11, 7, 6};
  for (std::size_t i = 0; i < curve.size(); ++i) {
    EXPECT_NEAR(curve[i].share, share[i], 5e-5);
    EXPECT_EQ(curve[i].at_risk, at_risk[i]);
    EXPECT_LT(curve[i].low, curve[i].share);
    EXPECT_GT(curve[i].high, curve[i].share);
  }
  // Greenwood's standard error at 6 weeks is 0.0764; log(-log) by hand.
  const double error = 0.0763604 / (0.857143 * std::abs(std::log(0.857143)));
  EXPECT_NEAR(curve[0].low, std::pow(0.857143, std::exp(1.959964 * error)), 1e-4);
  EXPECT_EQ(share_at(curve, 5.9), 1.0);
  EXPECT_NEAR(share_at(curve, 12.0), 0.7529, 5e-5);
}

TEST(SurvivalCurve, OfRunsThatAllFailEndsAtNothing) {
  const auto curve = survival_curve({{1.0, true, {}}, {2.0, true, {}}});
  EXPECT_EQ(curve.back().share, 0.0);
  EXPECT_EQ(curve.back().low, 0.0);
  EXPECT_TRUE(survival_curve({{3.0, false, {}}}).empty());
}

}  // namespace
}  // namespace tileflight::study::run_survival_test
