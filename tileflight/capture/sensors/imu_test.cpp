#include "tileflight/capture/sensors/imu.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::imu_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const SE3 kOnTheCamera(Eigen::Quaterniond(0.7, -0.1, 0.65, 0.2), Vec3(0.07, -0.05, 0.12));

MotionFunction at_rest() {
  return [](double) { return Motion{}; };
}

ImuOptions perfect(double rate_hz = 200.0) {
  ImuOptions options = imu_preset("perfect");
  options.rate_hz = rate_hz;
  return options;
}

flight_path::Path mission() {
  std::vector<flight_path::Waypoint> waypoints(4);
  waypoints[0] = {Vec3(0, 0, 30), {}, 10.0, -20.0, 0.0};
  waypoints[1] = {Vec3(40, 10, 35), {}, 90.0, -60.0, 5.0};
  waypoints[2] = {Vec3(50, 60, 28), {}, 200.0, -30.0, -5.0};
  waypoints[3] = {Vec3(0, 70, 30), {}, 260.0, -10.0, 0.0};
  return flight_path::path_through_waypoints(waypoints, {});
}

/// State of the integration of samples.
struct State {
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();  ///< R_local_imu: x y z w
  Vec3 velocity = Vec3::Zero(), position = Vec3::Zero();

  State plus(const State& d, double h) const {
    return {rotation + h * d.rotation, velocity + h * d.velocity, position + h * d.position};
  }
};

State derivative(const State& state, const geometry::ImuSample& sample) {
  const Eigen::Quaterniond q(state.rotation.data());
  const Vec3& w = sample.angular_rate_rad_s;
  return {0.5 * (q * Eigen::Quaterniond(0.0, w.x(), w.y(), w.z())).coeffs(),
          q.normalized() * sample.specific_force_m_s2 - 9.80665 * Vec3::UnitZ(), state.velocity};
}

/// Fourth-order Runge-Kutta step over two sample periods, with the middle sample as midpoint.
State integrated(State state, const std::vector<geometry::ImuSample>& samples) {
  for (std::size_t i = 0; i + 2 < samples.size(); i += 2) {
    const double h = samples[i + 2].time_s - samples[i].time_s;
    const State k1 = derivative(state, samples[i]);
    const State k2 = derivative(state.plus(k1, h / 2), samples[i + 1]);
    const State k3 = derivative(state.plus(k2, h / 2), samples[i + 1]);
    const State k4 = derivative(state.plus(k3, h), samples[i + 2]);
    state = state.plus(k1, h / 6).plus(k2, h / 3).plus(k3, h / 3).plus(k4, h / 6);
    state.rotation.normalize();
  }
  return state;
}

/// Final error of integrating a whole flight's samples: metres and radians.
std::pair<double, double> drift(const flight_path::Path& path, double rate_hz) {
  ImuOptions options = perfect(rate_hz);
  options.T_camera_imu = kOnTheCamera;
  const double end_s = std::floor(path.end_s());
  const ImuRecording recording = simulate_imu(motion_along(path), 0.0, end_s, options);
  EXPECT_EQ(recording.samples.size() % 2, 1U);
  const Motion first = rigidly_attached_motion(motion_along(path)(0.0), kOnTheCamera);
  const Motion last = rigidly_attached_motion(motion_along(path)(end_s), kOnTheCamera);
  const State end = integrated({first.T_local_body.rotation.coeffs(), first.velocity, first.T_local_body.translation},
                               recording.samples);
  EXPECT_LT((end.velocity - last.velocity).norm(), 1e-2);
  return {(end.position - last.T_local_body.translation).norm(),
          Eigen::Quaterniond(end.rotation.data()).angularDistance(last.T_local_body.rotation)};
}

TEST(Imu, PerfectSamplesIntegratedBackGiveThePathTheBetterTheFasterTheyAre) {
  const flight_path::Path path = mission();
  const auto [slow_m, slow_rad] = drift(path, 50.0);
  const auto [fast_m, fast_rad] = drift(path, 200.0);
  const auto [fastest_m, fastest_rad] = drift(path, 800.0);
  EXPECT_LT(slow_m, 0.05);
  EXPECT_LT(fast_m, slow_m / 8);
  EXPECT_LT(fastest_m, fast_m / 4);
  EXPECT_LT(fastest_m, 1e-4);
  EXPECT_LT(slow_rad, 1e-4);
  EXPECT_LT(fast_rad, slow_rad / 8);
  EXPECT_LT(fastest_rad, 1e-7);
}

TEST(Imu, AtRestItFeelsGravityUpwards) {
  ImuOptions options = perfect();
  options.T_camera_imu = kOnTheCamera;
  const geometry::ImuSample sample = simulate_imu(at_rest(), 0.0, 0.0, options).samples.at(0);
  EXPECT_LT(sample.angular_rate_rad_s.norm(), 1e-15);
  EXPECT_LT((kOnTheCamera.rotation * sample.specific_force_m_s2 - Vec3(0, 0, 9.80665)).norm(), 1e-12);
}

// A camera that turns in place with w = 2 + t about its own z axis, the IMU 0.5 m beside it along x: inwards w^2 r,
// forwards r dw/dt; gravity stays along z.
TEST(Imu, TheLeverArmIsFelt) {
  ImuOptions options = perfect(100.0);
  options.T_camera_imu = SE3(Eigen::Quaterniond::Identity(), Vec3(0.5, 0, 0));
  const MotionFunction turning = [](double t) {
    Motion motion;
    motion.T_local_body.rotation = Eigen::AngleAxisd(2 * t + t * t / 2, Vec3::UnitZ());
    motion.angular_velocity = (2 + t) * Vec3::UnitZ();
    motion.angular_acceleration = Vec3::UnitZ();
    return motion;
  };
  const std::vector<geometry::ImuSample> samples = simulate_imu(turning, 0.0, 3.0, options).samples;
  ASSERT_EQ(samples.size(), 301U);
  for (const geometry::ImuSample& sample : samples) {
    const double w = 2 + sample.time_s;
    EXPECT_LT((sample.specific_force_m_s2 - Vec3(-0.5 * w * w, 0.5, 9.80665)).norm(), 1e-12);
    EXPECT_LT((sample.angular_rate_rad_s - Vec3(0, 0, w)).norm(), 1e-12);
  }
}

/// Allan deviation of one axis at a cluster time (IEEE Std 952-1997, annex C).
double allan_deviation(const std::vector<geometry::ImuSample>& samples,
                       const std::function<double(const geometry::ImuSample&)>& value, double rate_hz,
                       double cluster_s) {
  const auto size = static_cast<std::size_t>(std::lround(cluster_s * rate_hz));
  std::vector<double> means;
  for (std::size_t i = 0; i + size <= samples.size(); i += size) {
    double sum = 0.0;
    for (std::size_t k = i; k < i + size; ++k) sum += value(samples[k]);
    means.push_back(sum / static_cast<double>(size));
  }
  double squares = 0.0;
  for (std::size_t i = 1; i < means.size(); ++i) squares += (means[i] - means[i - 1]) * (means[i] - means[i - 1]);
  return std::sqrt(squares / (2.0 * static_cast<double>(means.size() - 1)));
}

double rate_of_axis(const geometry::ImuSample& sample, int axis) { return sample.angular_rate_rad_s[axis]; }
double force_of_axis(const geometry::ImuSample& sample, int axis) { return sample.specific_force_m_s2[axis]; }

/// Root mean square over the axes.
double allan_deviation(const std::vector<geometry::ImuSample>& samples,
                       double (*value)(const geometry::ImuSample&, int), double rate_hz, double cluster_s) {
  double squares = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    squares += std::pow(allan_deviation(
                            samples, [&](const geometry::ImuSample& s) { return value(s, axis); }, rate_hz, cluster_s),
                        2);
  }
  return std::sqrt(squares / 3.0);
}

// White noise of density N has the Allan deviation N / sqrt(tau): 3 x 2000 clusters give it to 1 %.
TEST(Imu, WhiteNoiseHasItsDensity) {
  ImuOptions options = perfect(100.0);
  options.accelerometer_noise_density = 2e-3;
  options.gyroscope_noise_density = 1.7e-4;
  const auto samples = simulate_imu(at_rest(), 0.0, 2000.0, options).samples;
  ASSERT_EQ(samples.size(), 200'001U);
  for (const double tau : {0.1, 1.0}) {
    EXPECT_NEAR(allan_deviation(samples, force_of_axis, 100.0, tau) * std::sqrt(tau), 2e-3, 2e-3 * 0.04);
    EXPECT_NEAR(allan_deviation(samples, rate_of_axis, 100.0, tau) * std::sqrt(tau), 1.7e-4, 1.7e-4 * 0.04);
  }
}

// A bias that walks with K has the Allan deviation K sqrt(tau / 3): 3 x 200 clusters give it to 3 %.
TEST(Imu, TheBiasWalksAsItIsSaidTo) {
  ImuOptions options = perfect(10.0);
  options.accelerometer_random_walk = 3e-3;
  options.gyroscope_random_walk = 1.9e-5;
  const ImuRecording recording = simulate_imu(at_rest(), 0.0, 20000.0, options);
  const double expected = std::sqrt(100.0 / 3.0);
  EXPECT_NEAR(allan_deviation(recording.samples, force_of_axis, 10.0, 100.0) / expected, 3e-3, 3e-3 * 0.12);
  EXPECT_NEAR(allan_deviation(recording.samples, rate_of_axis, 10.0, 100.0) / expected, 1.9e-5, 1.9e-5 * 0.12);
  ASSERT_EQ(recording.samples.size(), 200'001U);
  ASSERT_EQ(recording.biases.size(), recording.samples.size());
  for (std::size_t i = 0; i < recording.samples.size(); i += 1000) {
    EXPECT_LT((recording.samples[i].angular_rate_rad_s - recording.biases[i].gyroscope_rad_s).norm(), 1e-15);
  }
}

TEST(Imu, ScaleMisalignmentBiasAndRangeAreApplied) {
  ImuOptions options = perfect();
  options.accelerometer_scale_misalignment(0, 2) = 0.01;
  options.accelerometer_scale_misalignment(2, 2) = 1.5;
  options.gyroscope_bias = Vec3(0.1, -0.2, 0.3);
  options.gyroscope_range_rad_s = 0.25;
  const geometry::ImuSample sample = simulate_imu(at_rest(), 0.0, 0.0, options).samples.at(0);
  EXPECT_LT((sample.specific_force_m_s2 - Vec3(0.0980665, 0, 14.709975)).norm(), 1e-12);
  EXPECT_LT((sample.angular_rate_rad_s - Vec3(0.1, -0.2, 0.25)).norm(), 1e-15);
}

TEST(Imu, TheSeedDecides) {
  const auto samples = [](std::uint64_t seed) { return simulate_imu(at_rest(), 0.0, 1.0, {.seed = seed}).samples; };
  const auto a = samples(1), b = samples(1), c = samples(2);
  ASSERT_EQ(a.size(), 201U);
  ASSERT_EQ(b.size(), a.size());
  ASSERT_EQ(c.size(), a.size());
  EXPECT_DOUBLE_EQ(a.back().time_s, 1.0);
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].specific_force_m_s2, b[i].specific_force_m_s2);
    EXPECT_NE(a[i].specific_force_m_s2, c[i].specific_force_m_s2);
  }
}

TEST(Imu, RefusesImpossibleOptions) {
  EXPECT_THAT([&] { simulate_imu(at_rest(), 0, 1, {.rate_hz = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("IMU rate: must lie between 0 and 100000 Hz")));
  EXPECT_THAT([&] { simulate_imu(at_rest(), 1, 0); },
              ThrowsMessage<InputError>(HasSubstr("IMU time span: ends before it starts")));
  EXPECT_THAT([&] { simulate_imu(at_rest(), 0, 1, {.gyroscope_noise_density = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("IMU gyroscope_noise_density: must be 0 or more")));
  EXPECT_THAT([&] { simulate_imu(at_rest(), 0, 1, {.gyroscope_range_rad_s = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("IMU gyroscope_range: must be more than 0")));
  EXPECT_THAT([&] { imu_preset("best"); }, ThrowsMessage<InputError>(HasSubstr("IMU 'best': is unknown")));
}

}  // namespace
}  // namespace tileflight::sensors::imu_test
