#include "tileflight/slam/inertial/factors.h"

#include <gtest/gtest.h>

#include "tileflight/slam/inertial/test_smooth_motion.h"

namespace tileflight::inertial::factors_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using test_support::kGravity_m_s2;
using test_support::lively_motion;
using Vec15 = Eigen::Matrix<double, kStateSize, 1>;

const geometry::ImuBias kBias{{0.02, -0.01, 0.015}, {0.2, -0.1, 0.15}};
const SE3 kT_imu_camera(Eigen::Quaterniond(0.7, -0.1, 0.65, 0.2), Vec3(0.07, -0.05, 0.12));

/// A state that is off the truth, so that no term of a derivative vanishes.
ImuState off(const ImuState& state, double sign) {
  Vec15 change;
  change << 0.05, -0.03, 0.02, 0.3, -0.2, 0.1, 0.2, 0.1, -0.3, 0.004, -0.002, 0.003, 0.02, -0.05, 0.03;
  return perturbed(state, sign * change);
}

/// Central differences of `residual` by a state's perturbation.
template <int kRows, class Function>
Eigen::Matrix<double, kRows, kStateSize> numerical(const Function& residual, const ImuState& at) {
  constexpr double h = 1e-5;
  Eigen::Matrix<double, kRows, kStateSize> J;
  for (int i = 0; i < kStateSize; ++i)
    J.col(i) = (residual(perturbed(at, h * Vec15::Unit(i))) - residual(perturbed(at, -h * Vec15::Unit(i)))) / (2 * h);
  return J;
}

TEST(InertialResidual, VanishesAtTheTruthAndWhereTheSamplesLead) {
  const auto motion = lively_motion();
  const auto between = preintegrate(motion.readings(0.0, 1.5, 400.0, kBias), 0.2, 1.2, kBias, {}).value();
  const ImuState first = motion.state(0.2, kBias), second = motion.state(1.2, kBias);
  EXPECT_LT(inertial_residual(between, first, second, kGravity_m_s2).value.norm(), 1e-4);
  const ImuState led = predicted(between, off(first, 1.0), kGravity_m_s2);
  EXPECT_LT(inertial_residual(between, off(first, 1.0), led, kGravity_m_s2).value.norm(), 1e-12);
}

TEST(InertialResidual, DerivativesAreThoseOfFiniteDifferences) {
  const auto motion = lively_motion();
  const auto between = preintegrate(motion.readings(0.0, 1.5, 200.0, kBias), 0.2, 1.2, kBias, {}).value();
  const ImuState first = off(motion.state(0.2, kBias), 1.0), second = off(motion.state(1.2, kBias), -1.0);
  const InertialResidual r = inertial_residual(between, first, second, kGravity_m_s2);
  const auto by_first = numerical<9>(
      [&](const ImuState& s) { return inertial_residual(between, s, second, kGravity_m_s2).value; }, first);
  const auto by_second = numerical<9>(
      [&](const ImuState& s) { return inertial_residual(between, first, s, kGravity_m_s2).value; }, second);
  EXPECT_LT((r.by_first - by_first).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((r.by_second - by_second).cwiseAbs().maxCoeff(), 1e-6);
}

/// The true step of a camera in a map of 1 / `scale` units a metre.
VisualStep true_step(const ImuState& first, const ImuState& second, double scale) {
  SE3 T = (first.T_world_imu * kT_imu_camera).inverse() * (second.T_world_imu * kT_imu_camera);
  T.translation /= scale;
  return {T, Mat6::Identity()};
}

TEST(VisualResidual, VanishesAtTheTruthAndIsTheRightTwistBesideIt) {
  const auto motion = lively_motion();
  const ImuState first = motion.state(0.2), second = motion.state(1.0);
  VisualStep step = true_step(first, second, 3.0);
  EXPECT_LT(visual_residual(step, first, second, kT_imu_camera, std::log(3.0)).value.norm(), 1e-12);
  geometry::Vec6 twist;
  twist << 1e-5, -2e-5, 3e-5, 2e-5, 1e-5, -1e-5;
  step.T_first_second = step.T_first_second * SE3::exp(-twist);
  EXPECT_LT((visual_residual(step, first, second, kT_imu_camera, std::log(3.0)).value - twist).norm(), 1e-8);
}

TEST(VisualResidual, DerivativesAreThoseOfFiniteDifferences) {
  const auto motion = lively_motion();
  const VisualStep step = true_step(motion.state(0.2), motion.state(1.0), 3.0);
  const ImuState first = off(motion.state(0.2), 1.0), second = off(motion.state(1.0), -1.0);
  const double log_scale = std::log(2.8), h = 1e-5;
  const VisualResidual r = visual_residual(step, first, second, kT_imu_camera, log_scale);
  const auto value = [&](const ImuState& a, const ImuState& b, const SE3& mounting, double log_s) {
    return visual_residual(step, a, b, mounting, log_s).value;
  };
  const auto by_first =
      numerical<6>([&](const ImuState& s) { return value(s, second, kT_imu_camera, log_scale); }, first);
  const auto by_second =
      numerical<6>([&](const ImuState& s) { return value(first, s, kT_imu_camera, log_scale); }, second);
  EXPECT_LT((r.by_first - by_first).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_LT((r.by_second - by_second).cwiseAbs().maxCoeff(), 1e-6);
  const geometry::Vec6 by_log_scale =
      (value(first, second, kT_imu_camera, log_scale + h) - value(first, second, kT_imu_camera, log_scale - h)) /
      (2 * h);
  EXPECT_LT((r.by_log_scale - by_log_scale).cwiseAbs().maxCoeff(), 1e-6);
  for (int i = 0; i < 3; ++i) {
    const auto mounted = [&](double d) {
      return SE3(kT_imu_camera.rotation * geometry::so3_exp(d * Vec3::Unit(i)), kT_imu_camera.translation);
    };
    const geometry::Vec6 column =
        (value(first, second, mounted(h), log_scale) - value(first, second, mounted(-h), log_scale)) / (2 * h);
    EXPECT_LT((r.by_mounting.col(i) - column).cwiseAbs().maxCoeff(), 1e-6) << i;
  }
}

/// Rotation (right perturbation) and position from `from` to `to`.
geometry::Vec6 pose_difference(const ImuState& from, const ImuState& to) {
  geometry::Vec6 d;
  d << geometry::so3_log(from.T_world_imu.rotation.conjugate() * to.T_world_imu.rotation),
      to.T_world_imu.translation - from.T_world_imu.translation;
  return d;
}

MeanReading reading_at(const test_support::SmoothMotion& motion, double t) {
  const geometry::ImuSample sample = motion.reading(t, kBias);
  return {sample.angular_rate_rad_s, sample.specific_force_m_s2, 0.0};
}

TEST(MovedOn, FollowsTheMotionForAShortTime) {
  const auto motion = lively_motion();
  for (const double dt : {0.02, -0.02}) {
    const LaterState later = moved_on(motion.state(0.7, kBias), reading_at(motion, 0.7), dt, kGravity_m_s2);
    EXPECT_LT(pose_difference(later.state, motion.state(0.7 + dt)).norm(), 2e-4) << dt;
    EXPECT_LT((later.state.velocity_m_s - motion.velocity(0.7 + dt)).norm(), 2e-3) << dt;
  }
  const LaterState same = moved_on(motion.state(0.7, kBias), reading_at(motion, 0.7), 0.0, kGravity_m_s2);
  EXPECT_LT(pose_difference(same.state, motion.state(0.7)).norm(), 1e-12);
}

TEST(MovedOn, DerivativesAreThoseOfFiniteDifferences) {
  const auto motion = lively_motion();
  const MeanReading reading = reading_at(motion, 0.9);
  const ImuState at = off(motion.state(0.7, kBias), 1.0);
  constexpr double later_s = 0.05, h = 1e-5;
  const LaterState later = moved_on(at, reading, later_s, kGravity_m_s2);
  const auto by_state = numerical<6>(
      [&](const ImuState& s) {
        return pose_difference(later.state, moved_on(s, reading, later_s, kGravity_m_s2).state);
      },
      at);
  EXPECT_LT((later.by_state - by_state).cwiseAbs().maxCoeff(), 1e-6);
  const auto moved = [&](double dt) {
    return pose_difference(later.state, moved_on(at, reading, later_s + dt, kGravity_m_s2).state);
  };
  EXPECT_LT((later.by_time - (moved(h) - moved(-h)) / (2 * h)).cwiseAbs().maxCoeff(), 1e-6);
}

}  // namespace
}  // namespace tileflight::inertial::factors_test
