#include "tileflight/capture/sensors/attitude.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::attitude_test {
namespace {

using geometry::SE3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

SE3 turning(double time_s) { return {geometry::so3_exp({0.3, 0.2 * time_s, -0.1}), Vec3::Zero()}; }

TEST(Attitude, WithoutErrorsItIsThePose) {
  const AttitudeOptions perfect{.noise_deg = 0, .tilt_bias_sigma_deg = 0, .yaw_bias_sigma_deg = 0};
  const auto samples = simulate_attitude(turning, {1.0, 4.0, 10.0}, perfect);
  ASSERT_EQ(samples.size(), 31U);
  for (const AttitudeSample& s : samples) EXPECT_LT(s.R_local_camera.angularDistance(turning(s.time_s).rotation), 1e-7);
}

/// Over many seeds the error about each local axis has the stated deviation.
TEST(Attitude, ErrorsHaveTheirStatistics) {
  Vec3 squares = Vec3::Zero();
  constexpr int kSeeds = 2000;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    const AttitudeOptions options{.seed = static_cast<std::uint64_t>(seed)};
    const auto samples = simulate_attitude(turning, {0.0, 0.05, 10.0}, options);
    const Vec3 error = geometry::so3_log(samples[0].R_local_camera * turning(samples[0].time_s).rotation.conjugate());
    squares += error.cwiseProduct(error) / kSeeds;
  }
  const Vec3 sigma_deg = squares.cwiseSqrt() * 180.0 / std::numbers::pi;
  EXPECT_NEAR(sigma_deg.x(), tilt_sigma_deg({}), 0.03);
  EXPECT_NEAR(sigma_deg.z(), yaw_sigma_deg({}), 0.15);
}

TEST(Attitude, ImpossibleOptionsAreRefused) {
  EXPECT_THAT(
      [&] {
        simulate_attitude(turning, {0, 1, 10}, {.noise_deg = -1.0});
      },
      ThrowsMessage<InputError>(HasSubstr("attitude errors: must not be negative")));
  EXPECT_THAT([&] { check({.rate_hz = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("attitude rate_hz: must lie between 0 and 100000")));
  EXPECT_THAT([&] { check({.bias_time_s = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("attitude bias_time_s: must be more than 0")));
}

}  // namespace
}  // namespace tileflight::sensors::attitude_test
