#include "tileflight/slam/inertial/preintegration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include "tileflight/slam/inertial/test_smooth_motion.h"

namespace tileflight::inertial::preintegration_test {
namespace {

using geometry::Vec3;
using test_support::kGravity_m_s2;
using test_support::lively_motion;
using test_support::SmoothMotion;
using Vec9 = Eigen::Matrix<double, 9, 1>;

const geometry::ImuBias kBias{{0.02, -0.01, 0.015}, {0.2, -0.1, 0.15}};

/// second = first + difference, in the order of the covariance.
Vec9 difference(const Increment& first, const Increment& second) {
  Vec9 d;
  d << geometry::so3_log(first.rotation.conjugate() * second.rotation), second.velocity - first.velocity,
      second.position - first.position;
  return d;
}

/// The increment by its definition, Forster (33), from the true motion.
Increment true_increment(const SmoothMotion& motion, double from_s, double to_s) {
  const ImuState a = motion.state(from_s), b = motion.state(to_s);
  const double dt = to_s - from_s;
  const Vec3 g(0, 0, -kGravity_m_s2);
  const Eigen::Quaterniond R_t = a.T_world_imu.rotation.conjugate();
  return {R_t * b.T_world_imu.rotation, R_t * (b.velocity_m_s - a.velocity_m_s - dt * g),
          R_t * (b.T_world_imu.translation - a.T_world_imu.translation - dt * a.velocity_m_s - 0.5 * dt * dt * g)};
}

double error_at_rate(double rate_hz) {
  const SmoothMotion motion = lively_motion();
  const auto sum = preintegrate(motion.readings(0.0, 3.0, rate_hz, kBias), 0.5, 2.5, kBias, {});
  return difference(true_increment(motion, 0.5, 2.5), sum.value().increment).norm();
}

TEST(Preintegration, IsTheMotionsOwnIncrementToSecondOrderInTheSampleTime) {
  const double slow = error_at_rate(100.0), fast = error_at_rate(400.0), fastest = error_at_rate(1600.0);
  EXPECT_LT(slow, 1e-3);
  EXPECT_NEAR(slow / fast, 16.0, 2.0);
  EXPECT_NEAR(fast / fastest, 16.0, 2.0);
}

TEST(Preintegration, OfTwoPartsIsThatOfTheWhole) {
  const auto samples = lively_motion().readings(0.0, 2.0, 200.0);
  const auto a = preintegrate(samples, 0.1, 0.9035, kBias, {}).value(),
             b = preintegrate(samples, 0.9035, 1.7, kBias, {}).value();
  const auto whole = preintegrate(samples, 0.1, 1.7, kBias, {}).value();
  const Increment joined{
      a.increment.rotation * b.increment.rotation, a.increment.velocity + a.increment.rotation * b.increment.velocity,
      a.increment.position + b.duration_s * a.increment.velocity + a.increment.rotation * b.increment.position};
  EXPECT_LT(difference(whole.increment, joined).norm(), 1e-6);  // a step more: its readings' mean differs slightly
  EXPECT_NEAR(whole.duration_s, 1.6, 1e-12);
}

/// Central differences of a function of the biases (gyroscope's in columns 0 to 2).
template <class Function>
Eigen::Matrix<double, 9, 6> by_bias(const Function& increment, const geometry::ImuBias& at, double h) {
  Eigen::Matrix<double, 9, 6> J;
  for (int i = 0; i < 6; ++i) {
    geometry::ImuBias less = at, more = at;
    (i < 3 ? less.gyroscope_rad_s : less.accelerometer_m_s2)[i % 3] -= h;
    (i < 3 ? more.gyroscope_rad_s : more.accelerometer_m_s2)[i % 3] += h;
    const Increment middle = increment(at);
    J.col(i) = (difference(middle, increment(more)) - difference(middle, increment(less))) / (2 * h);
  }
  return J;
}

TEST(Preintegration, DerivativesByTheBiasesAreThoseOfIntegratingAgain) {
  const auto samples = lively_motion().readings(0.0, 2.0, 200.0);
  const auto again = [&](const geometry::ImuBias& bias) {
    return preintegrate(samples, 0.2, 1.3, bias, {}).value().increment;
  };
  const auto sum = preintegrate(samples, 0.2, 1.3, kBias, {}).value();
  Eigen::Matrix<double, 9, 6> J;
  J << sum.by_gyroscope_bias, sum.by_accelerometer_bias;
  EXPECT_LT((J - by_bias(again, kBias, 1e-4)).cwiseAbs().maxCoeff(), 1e-6);
}

// The error of the correction falls with the square of the change.
TEST(Preintegration, CorrectedForANearBiasIsThatOfIntegratingAgain) {
  const auto samples = lively_motion().readings(0.0, 2.0, 200.0);
  const auto error = [&](double change) {
    geometry::ImuBias other = kBias;
    other.gyroscope_rad_s += change * Vec3(0.3, -0.8, 0.5);
    other.accelerometer_m_s2 += change * Vec3(2.0, 3.0, -1.0);
    const auto sum = preintegrate(samples, 0.2, 1.3, kBias, {}).value();
    const auto again = preintegrate(samples, 0.2, 1.3, other, {}).value();
    return difference(again.increment, sum.corrected(other)).norm();
  };
  EXPECT_LT(error(0.01), 1e-3);
  EXPECT_NEAR(error(0.02) / error(0.01), 4.0, 0.3);
}

// 2000 draws give the covariance's entries to about 3 % of their size, and the mean squared Mahalanobis distance, 9, to
// 0.1.
TEST(Preintegration, CovarianceIsThatOfManyNoisyUnits) {
  const ImuNoise noise{.accelerometer_noise_density = 2e-2,
                       .accelerometer_random_walk = 0.0,
                       .gyroscope_noise_density = 2e-3,
                       .gyroscope_random_walk = 0.0};
  constexpr int kDraws = 2000;
  const auto clean = lively_motion().readings(0.0, 1.0, 100.0);
  const auto sum = preintegrate(clean, 0.0, 1.0, {}, noise).value();
  Mat9 sampled = Mat9::Zero();
  double mahalanobis = 0.0;
  for (unsigned draw = 0; draw < kDraws; ++draw) {
    auto noisy = clean;
    test_support::add_noise(noise, 100.0, draw + 1, noisy);
    const Vec9 d = difference(sum.increment, preintegrate(noisy, 0.0, 1.0, {}, noise).value().increment);
    sampled += d * d.transpose() / kDraws;
    mahalanobis += d.dot(sum.covariance.ldlt().solve(d)) / kDraws;
  }
  const Vec9 sigma = sum.covariance.diagonal().cwiseSqrt();
  const Mat9 relative =
      sigma.cwiseInverse().asDiagonal() * (sampled - sum.covariance) * sigma.cwiseInverse().asDiagonal();
  EXPECT_LT(relative.cwiseAbs().maxCoeff(), 0.12);
  EXPECT_NEAR(mahalanobis, 9.0, 0.4);
}

TEST(Preintegration, NeedsSamplesOverTheWholeInterval) {
  const auto samples = lively_motion().readings(1.0, 2.0, 100.0);
  EXPECT_TRUE(preintegrate(samples, 1.0, 2.0, {}, {}));
  EXPECT_FALSE(preintegrate(samples, 0.99, 2.0, {}, {}));
  EXPECT_FALSE(preintegrate(samples, 1.0, 2.01, {}, {}));
  EXPECT_FALSE(preintegrate(samples, 1.5, 1.5, {}, {}));
  EXPECT_FALSE(preintegrate({}, 1.0, 2.0, {}, {}));
}

TEST(Preintegration, PlayedBackwardsUndoesTheMotion) {
  const SmoothMotion motion = lively_motion();
  const auto samples = reversed(motion.readings(0.0, 2.0, 400.0));
  const auto sum = preintegrate(samples, -1.8, -0.3, {}, {}).value();
  ImuState end = motion.state(1.8);
  end.velocity_m_s = -end.velocity_m_s;
  const ImuState begin = predicted(sum, end, kGravity_m_s2);
  EXPECT_LT((begin.T_world_imu.translation - motion.pose(0.3).translation).norm(), 1e-4);
  EXPECT_LT((begin.velocity_m_s + motion.velocity(0.3)).norm(), 1e-4);
  EXPECT_LT(begin.T_world_imu.rotation.angularDistance(motion.rotation(0.3)), 1e-5);
}

}  // namespace
}  // namespace tileflight::inertial::preintegration_test
