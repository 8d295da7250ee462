#include "tileflight/capture/flight_path/smooth_path.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

#include "tests/refusal.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::flight_path::smooth_path_test {
namespace {

using geometry::SE3;
using geometry::so3_exp;
using geometry::so3_log;
using geometry::Trajectory;
using geometry::Vec3;

using PoseAt = std::function<SE3(double)>;

constexpr double kDegree = std::numbers::pi / 180.0;

/// A flight that bends, climbs and looks around, with derivatives of any order.
SE3 smooth_flight(double t) {
  const Vec3 position(8 * t + 3 * std::sin(0.7 * t), 6 * std::cos(0.5 * t), 40 + 2 * std::sin(0.9 * t));
  return {
      so3_exp({0.3 * std::sin(0.8 * t), 0.1 * t, 0}) * so3_exp({0, 0.05 * std::cos(1.1 * t), 0.4 * std::sin(0.6 * t)}),
      position};
}

Trajectory sampled(const PoseAt& pose_at, double end_s, double rate_hz) {
  Trajectory trajectory;
  for (int i = 0; i <= static_cast<int>(std::lround(end_s * rate_hz)); ++i)
    trajectory.poses.push_back({5 + i / rate_hz, pose_at(i / rate_hz)});
  return trajectory;
}

Trajectory noisy(Trajectory trajectory, double sigma_m, double sigma_rad) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const auto vector = [&] { return Vec3(normal(random), normal(random), normal(random)); };
  for (geometry::StampedPose& pose : trajectory.poses) {
    pose.T_local_camera.translation += sigma_m * vector();
    pose.T_local_camera.rotation = pose.T_local_camera.rotation * so3_exp(sigma_rad * vector());
  }
  return trajectory;
}

/// RMS of a distance over the interior of a path.
double rms(const Path& path, const std::function<double(double)>& distance) {
  double sum = 0;
  int count = 0;
  for (double t = path.start_s() + 0.5; t < path.end_s() - 0.5; t += 0.013, ++count) sum += std::pow(distance(t), 2);
  return std::sqrt(sum / count);
}

double position_error_m(const Path& path, const PoseAt& truth) {
  return rms(path, [&](double t) { return (path.pose(t).translation - truth(t - 5).translation).norm(); });
}
double rotation_error_rad(const Path& path, const PoseAt& truth) {
  return rms(path, [&](double t) { return path.pose(t).rotation.angularDistance(truth(t - 5).rotation); });
}
double velocity_error_m_s(const Path& path, const PoseAt& truth) {
  const double h = 1e-4;
  return rms(path, [&](double t) {
    return (path.velocity(t) - (truth(t - 5 + h).translation - truth(t - 5 - h).translation) / (2 * h)).norm();
  });
}
double rate_error_rad_s(const Path& path, const PoseAt& truth) {
  const double h = 1e-4;
  return rms(path, [&](double t) {
    const Vec3 turned = so3_log(truth(t - 5 - h).rotation.conjugate() * truth(t - 5 + h).rotation);
    return (path.angular_velocity(t) - turned / (2 * h)).norm();
  });
}

RotationSpline random_rotations(const UniformKnots& knots, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> number(-0.5, 0.5);
  RotationSpline spline{knots, {Eigen::Quaterniond(0.1, 0.7, -0.5, 0.2).normalized()}};
  while (spline.controls.size() < knots.control_count())
    spline.controls.push_back(spline.controls.back() * so3_exp({number(random), number(random), number(random)}));
  return spline;
}

BSpline<3> random_positions(const UniformKnots& knots, unsigned seed) {
  std::srand(seed);
  BSpline<3> spline{knots, {}};
  while (spline.controls.size() < knots.control_count()) spline.controls.push_back(20 * Vec3::Random());
  return spline;
}

TEST(BSpline, WeightsAreAShareOfOneAndLinearMotionIsKept) {
  for (const double u : {0.0, 0.3, 0.5, 1.0}) {
    const Weights4 b = basis(u), first = basis_derivative(u), second = basis_second_derivative(u);
    EXPECT_NEAR(b[0] + b[1] + b[2] + b[3], 1, 1e-15);
    EXPECT_NEAR(b[1] + 2 * b[2] + 3 * b[3], 1 + u, 1e-15);
    EXPECT_NEAR(first[0] + first[1] + first[2] + first[3], 0, 1e-15);
    EXPECT_NEAR(second[1] + 2 * second[2] + 3 * second[3], 0, 1e-15);
  }
}

TEST(BSpline, DerivativesAreThoseOfFiniteDifferences) {
  const Path path = path_along_splines(random_positions({2, 0.5, 6}, 3), random_rotations({2, 0.5, 6}, 4));
  EXPECT_EQ(path.start_s(), 2);
  EXPECT_EQ(path.end_s(), 5);
  const double h = 1e-5;
  for (double t = 2.1; t < 4.95; t += 0.0937) {
    const auto slope = [&](auto value) { return Vec3((value(t + h) - value(t - h)) / (2 * h)); };
    EXPECT_LT((slope([&](double s) { return path.pose(s).translation; }) - path.velocity(t)).norm(), 1e-6);
    EXPECT_LT((slope([&](double s) { return path.velocity(s); }) - path.acceleration(t)).norm(), 1e-6);
    EXPECT_LT((slope([&](double s) { return path.angular_velocity(s); }) - path.angular_acceleration(t)).norm(), 1e-6);
    const Vec3 turned = so3_log(path.pose(t - h).rotation.conjugate() * path.pose(t + h).rotation) / (2 * h);
    EXPECT_LT((turned - path.angular_velocity(t)).norm(), 1e-6);
  }
}

TEST(BSpline, TwiceContinuousAcrossKnots) {
  const Path path = path_along_splines(random_positions({0, 0.25, 8}, 5), random_rotations({0, 0.25, 8}, 6));
  for (double knot = 0.25; knot < 2; knot += 0.25) {
    const double before = knot - 1e-9, behind = knot + 1e-9;
    EXPECT_LT((path.acceleration(before) - path.acceleration(behind)).norm(), 1e-3);
    EXPECT_LT((path.angular_velocity(before) - path.angular_velocity(behind)).norm(), 1e-6);
    EXPECT_LT((path.angular_acceleration(before) - path.angular_acceleration(behind)).norm(), 1e-4);
  }
}

TEST(RotationSpline, SensitivityIsThatOfFiniteDifferences) {
  const RotationSpline spline = random_rotations({0, 1, 3}, 9);
  const RotationSpline::Sensitivity at = spline.sensitivity(1.3);
  EXPECT_LT(at.rotation.angularDistance(spline.at(1.3)), 1e-14);
  const double h = 1e-6;
  for (std::size_t k = 0; k < 4; ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto turned = [&](double angle) {
        RotationSpline changed = spline;
        changed.controls[at.segment + k] = changed.controls[at.segment + k] * so3_exp(angle * Vec3::Unit(axis));
        return so3_log(at.rotation.conjugate() * changed.at(1.3));
      };
      EXPECT_LT(((turned(h) - turned(-h)) / (2 * h) - at.control_jacobians[k].col(axis)).norm(), 1e-8) << k << axis;
    }
  }
}

TEST(RotationSpline, ATurnAtAConstantRateIsExact) {
  const Vec3 rate(0.3, -0.2, 0.9);
  RotationSpline spline{{0, 0.5, 10}, {}};
  for (std::size_t i = 0; i < spline.knots.control_count(); ++i)
    spline.controls.push_back(so3_exp(rate * spline.knots.control_time_s(i)));
  for (double t = 0; t <= 5; t += 0.11) {
    EXPECT_LT(spline.at(t).angularDistance(so3_exp(rate * t)), 1e-12);
    EXPECT_LT((spline.angular_motion(t).rate - rate).norm(), 1e-12);
    EXPECT_LT(spline.angular_motion(t).acceleration.norm(), 1e-12);
  }
}

TEST(FitSpline, WhatLiesInTheSplinesSpaceIsFoundAgain) {
  const UniformKnots knots{5, 0.4, 25};
  const BSpline<3> positions = random_positions(knots, 1);
  const RotationSpline rotations = random_rotations(knots, 2);
  std::vector<double> times;
  std::vector<Vec3> points;
  std::vector<Eigen::Quaterniond> turns;
  for (double t = 5; t <= 15 + 1e-9; t += 0.1) {
    times.push_back(t);
    points.push_back(positions.value(t));
    turns.push_back(rotations.at(t));
  }
  const BSpline<3> fitted = fit_positions(times, points, knots);
  const RotationSpline fitted_turns = fit_rotations(times, turns, knots);
  for (std::size_t i = 0; i < knots.control_count(); ++i) {
    EXPECT_LT((fitted.controls[i] - positions.controls[i]).norm(), 1e-7) << i;
    EXPECT_LT(fitted_turns.controls[i].angularDistance(rotations.controls[i]), 1e-8) << i;
  }
}

/// Dense normal equations of the same fit.
TEST(FitSpline, PositionsAreTheLeastSquaresOnes) {
  const UniformKnots knots{0, 1, 5};
  const Trajectory poses = noisy(sampled(smooth_flight, 5, 12), 0.2, 0);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(poses.size()), 8);
  Eigen::MatrixXd b(A.rows(), 3);
  std::vector<double> times;
  std::vector<Vec3> points;
  for (Eigen::Index row = 0; row < A.rows(); ++row) {
    const geometry::StampedPose& pose = poses.poses[static_cast<std::size_t>(row)];
    times.push_back(pose.time_s - 5);
    points.push_back(pose.T_local_camera.translation);
    const auto [segment, u] = knots.find_span(times.back());
    for (int k = 0; k < 4; ++k) A(row, static_cast<Eigen::Index>(segment) + k) = basis(u)[static_cast<std::size_t>(k)];
    b.row(row) = points.back().transpose();
  }
  const Eigen::MatrixXd dense = (A.transpose() * A).ldlt().solve(A.transpose() * b);
  const BSpline<3> banded = fit_positions(times, points, knots);
  for (Eigen::Index i = 0; i < 8; ++i)
    EXPECT_LT((banded.controls[static_cast<std::size_t>(i)].transpose() - dense.row(i)).norm(), 1e-8);
}

TEST(SmoothPath, NoiseIsReducedAndTold) {
  const double sigma_m = 0.1, sigma_rad = 0.5 * kDegree;
  const Trajectory poses = noisy(sampled(smooth_flight, 20, 30), sigma_m, sigma_rad);
  const SmoothPath smooth = smooth_path(poses);
  const Path through = path_through_poses(poses);
  EXPECT_NEAR(smooth.position.sigma, sigma_m, 0.1 * sigma_m);
  EXPECT_NEAR(smooth.rotation.sigma, sigma_rad, 0.1 * sigma_rad);
  EXPECT_LT(position_error_m(smooth.path, smooth_flight), 0.35 * position_error_m(through, smooth_flight));
  EXPECT_LT(rotation_error_rad(smooth.path, smooth_flight), 0.35 * rotation_error_rad(through, smooth_flight));
  EXPECT_LT(velocity_error_m_s(smooth.path, smooth_flight), 0.02 * velocity_error_m_s(through, smooth_flight));
  EXPECT_LT(rate_error_rad_s(smooth.path, smooth_flight), 0.02 * rate_error_rad_s(through, smooth_flight));
}

/// Among spacings a factor of 1.4 apart, none is much better than the one chosen by cross validation.
TEST(SmoothPath, CrossValidationChoosesNearTheBestSpacing) {
  const Trajectory poses = noisy(sampled(smooth_flight, 20, 30), 0.1, 0.5 * kDegree);
  const SmoothPath chosen = smooth_path(poses);
  double best_m = 1e9, best_rad = 1e9;
  for (double spacing_s = 0.05; spacing_s < 8; spacing_s *= 1.4) {
    const Path path = smooth_path(poses, {.knot_spacing_s = spacing_s}).path;
    best_m = std::min(best_m, position_error_m(path, smooth_flight));
    best_rad = std::min(best_rad, rotation_error_rad(path, smooth_flight));
  }
  EXPECT_LT(position_error_m(chosen.path, smooth_flight), 1.25 * best_m);
  EXPECT_LT(rotation_error_rad(chosen.path, smooth_flight), 1.25 * best_rad);
}

TEST(SmoothPath, WithoutNoiseItKeepsTheMotion) {
  const SmoothPath smooth = smooth_path(sampled(smooth_flight, 20, 10));
  EXPECT_LT(position_error_m(smooth.path, smooth_flight), 1e-3);
  EXPECT_LT(rotation_error_rad(smooth.path, smooth_flight), 1e-4);
  EXPECT_LT(smooth.position.sigma, 1e-3);
}

TEST(SmoothPath, KnownNoiseLeavesNoMoreThanIt) {
  const Trajectory poses = noisy(sampled(smooth_flight, 20, 30), 0.1, 0.5 * kDegree);
  const SmoothPath fit = smooth_path(poses, {.position_sigma_m = 0.3, .rotation_sigma_rad = 3 * kDegree});
  EXPECT_LE(fit.position.sigma, 0.3);
  EXPECT_LE(fit.rotation.sigma, 3 * kDegree);
  EXPECT_GE(fit.position.knot_spacing_s, smooth_path(poses).position.knot_spacing_s);
  const SmoothPath tight = smooth_path(poses, {.position_sigma_m = 1e-6, .rotation_sigma_rad = 1e-6});
  EXPECT_TRUE(tight.path.pose(6).translation.allFinite());  // no spacing reaches so small a residual
}

TEST(SmoothPath, GapsAreBridged) {
  Trajectory poses = noisy(sampled(smooth_flight, 20, 30), 0.02, 0.1 * kDegree);
  std::erase_if(poses.poses, [](const geometry::StampedPose& pose) { return pose.time_s > 14 && pose.time_s < 15.5; });
  const SmoothPath smooth = smooth_path(poses, {.knot_spacing_s = 0.3});
  for (double t = 14; t < 15.5; t += 0.1) {
    EXPECT_LT((smooth.path.pose(t).translation - smooth_flight(t - 5).translation).norm(), 0.5);
    EXPECT_LT(smooth.path.pose(t).rotation.angularDistance(smooth_flight(t - 5).rotation), 0.05);
  }
}

TEST(SmoothPath, DoesNotDependOnTheFrame) {
  const Trajectory poses = noisy(sampled(smooth_flight, 10, 10), 0.1, kDegree);
  const SE3 T_b_a(so3_exp({1, -2, 0.5}), {100, -30, 7});
  Trajectory moved = poses;
  for (geometry::StampedPose& pose : moved.poses) pose.T_local_camera = T_b_a * pose.T_local_camera;
  const Path here = smooth_path(poses).path, there = smooth_path(moved).path;
  for (double t = 5; t < 15; t += 0.37) {
    EXPECT_LT((T_b_a * here.pose(t).translation - there.pose(t).translation).norm(), 1e-6);
    EXPECT_LT((T_b_a.rotation * here.pose(t).rotation).angularDistance(there.pose(t).rotation), 1e-6);
  }
}

TEST(SmoothPath, WhatCannotBeSmoothedIsOneClearLine) {
  const auto refusal = [](const Trajectory& poses, const SmoothingOptions& options) {
    return tests::refusal_of([&] { smooth_path(poses, options); });
  };
  const Trajectory poses = sampled(smooth_flight, 1, 10);
  EXPECT_THAT(refusal(sampled(smooth_flight, 0.5, 10), {}),
              testing::HasSubstr("has 6 poses, and smoothing needs at least 8"));
  EXPECT_THAT(refusal(poses, {.knot_spacing_s = 0.0}), testing::HasSubstr("knot_spacing_s"));
  EXPECT_THAT(refusal(poses, {.position_sigma_m = -1.0}), testing::HasSubstr("position_sigma_m"));
  EXPECT_EQ(refusal(poses, {.knot_spacing_s = 100.0}), "no error");  // one segment
}

}  // namespace
}  // namespace tileflight::flight_path::smooth_path_test
