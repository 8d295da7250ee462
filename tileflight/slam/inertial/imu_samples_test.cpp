#include "tileflight/slam/inertial/imu_samples.h"

#include <gtest/gtest.h>

#include "tileflight/slam/inertial/test_smooth_motion.h"

namespace tileflight::inertial::imu_samples_test {
namespace {

TEST(ImuNoise, IsAtLeastWhatTheReadingsScatterBy) {
  for (const double rate_hz : {100.0, 400.0}) {
    std::vector<geometry::ImuSample> samples = test_support::lively_motion().readings(0.0, 20.0, rate_hz);
    const ImuNoise assumed;
    EXPECT_EQ(at_least_scatter(assumed, samples).accelerometer_noise_density, assumed.accelerometer_noise_density)
        << "motion is no noise";
    EXPECT_EQ(at_least_scatter(assumed, samples).gyroscope_noise_density, assumed.gyroscope_noise_density);
    const ImuNoise true_noise{.accelerometer_noise_density = 0.08, .gyroscope_noise_density = 0.004};
    test_support::add_noise(true_noise, rate_hz, 3, samples);
    const ImuNoise found = at_least_scatter(assumed, samples);
    EXPECT_NEAR(found.accelerometer_noise_density, 0.08, 0.004) << rate_hz;
    EXPECT_NEAR(found.gyroscope_noise_density, 0.004, 0.0002) << rate_hz;
  }
}

}  // namespace
}  // namespace tileflight::inertial::imu_samples_test
