#include "tileflight/evaluation/metrics/trajectory_drift.h"

#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::metrics::trajectory_drift_test {
namespace {

using geometry::Trajectory;
using geometry::Vec3;

const double kDegree = std::acos(-1.0) / 180.0;

geometry::StampedPose pose(int k, const Vec3& position, double yaw_rad = 0.0) {
  return {0.1 * k, {geometry::so3_exp({0, 0, yaw_rad}), position}};
}

Trajectory straight(int steps, double step_m) {
  Trajectory trajectory;
  for (int k = 0; k <= steps; ++k) trajectory.poses.push_back(pose(k, {step_m * k, 0, 0}));
  return trajectory;
}

TEST(TrajectoryDrift, StretchesFitThePath) {
  for (const auto& [path_m, stretch] : {std::pair{5000.0, 100.0},
                                        {1000.0, 100.0},
                                        {999.0, 50.0},
                                        {312.0, 20.0},
                                        {190.0, 10.0},
                                        {4.6, 0.2},
                                        {0.0, 0.0}}) {
    EXPECT_NEAR(choose_segment_length_m(path_m), stretch, 1e-12) << path_m;
  }
}

// A constant rotation of w per metre bends a straight path of d metres to an arc: (sin wd, 1 - cos wd) / w.
TEST(TrajectoryDrift, ConstantYawDriftHasAClosedForm) {
  const double w = 0.02 * kDegree;
  const Trajectory truth = straight(400, 0.5);
  Trajectory estimate;
  for (int k = 0; k <= 400; ++k) {
    const double s = 0.5 * k;
    estimate.poses.push_back(pose(k, {std::sin(w * s) / w, (1.0 - std::cos(w * s)) / w, 0}, w * s));
  }
  double sum = 0.0, count = 0.0;
  for (int stretch = 1; stretch <= 8; ++stretch) {
    const double d = 20.0 * stretch, starts = 401 - 2 * d;
    sum += starts * std::hypot(std::sin(w * d) / w - d, (1.0 - std::cos(w * d)) / w) / d;
    count += starts;
  }
  const PathDrift drift = compute_path_drift(estimate, truth);
  EXPECT_EQ(drift.segment_length_m, 20.0);
  EXPECT_EQ(drift.subpaths, static_cast<std::size_t>(count));
  EXPECT_NEAR(drift.rotation_deg_per_m, 0.02, 1e-9);
  EXPECT_NEAR(drift.translation_percent, 100.0 * sum / count, 1e-9);
  EXPECT_LT(compute_scale_drift(estimate, truth).max_deviation, 1e-6) << "a turn is none of scale";
}

TEST(TrajectoryDrift, OnePercentTooLongIsOnePercent) {
  const PathDrift drift = compute_path_drift(straight(300, 1.01), straight(300, 1.0));
  EXPECT_NEAR(drift.translation_percent, 1.0, 1e-9);
  EXPECT_NEAR(drift.rotation_deg_per_m, 0.0, 1e-9);
}

// Steps that grow by 1 + a s (s: middle of the step on the true path) make segments too long by 1 + a times their
// midpoint.
TEST(TrajectoryDrift, LinearScaleDriftHasAClosedForm) {
  const double a = 5e-4;
  const Trajectory truth = straight(200, 1.0);
  Trajectory estimate = truth;
  for (int k = 1; k <= 200; ++k) {
    const Vec3 before = estimate.poses[static_cast<std::size_t>(k) - 1].T_local_camera.translation;
    estimate.poses[static_cast<std::size_t>(k)].T_local_camera.translation = before + Vec3(0, 1.0 + a * (k - 0.5), 0);
  }
  double squares = 0.0;
  for (int k = 0; k < 10; ++k) squares += std::pow(1.0 / (1.0 + a * (20.0 * k + 10.0)) - 1.0, 2);
  const ScaleDrift drift = compute_scale_drift(estimate, truth);
  EXPECT_EQ(drift.segment_length_m, 20.0);
  EXPECT_EQ(drift.segments, 10u);
  EXPECT_NEAR(drift.max_deviation, 1.0 - 1.0 / (1.0 + a * 190.0), 1e-12);
  EXPECT_NEAR(drift.rms, std::sqrt(squares / 10.0), 1e-12);
}

TEST(TrajectoryDrift, OfAPathWithoutLengthIsNotANumber) {
  const Trajectory still = straight(5, 0.0);
  EXPECT_EQ(compute_path_drift(still, still).subpaths, 0u);
  EXPECT_TRUE(std::isnan(compute_path_drift(still, still).translation_percent));
  EXPECT_TRUE(std::isnan(compute_scale_drift(still, still).rms));
}

}  // namespace
}  // namespace tileflight::metrics::trajectory_drift_test
