#include "tileflight/slam/inertial/imu_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tileflight/core/base/input_error.h"
#include "tileflight/slam/inertial/test_smooth_motion.h"

namespace tileflight::inertial::imu_check_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

std::vector<geometry::ImuSample> recording() {
  auto samples = test_support::lively_motion().readings(0.0, 10.0, 200.0);
  test_support::add_noise({}, 200.0, 7, samples);
  return samples;
}

void expect_refused(const std::vector<geometry::ImuSample>& samples, const char* message) {
  EXPECT_THAT([&] { check_readings(samples, {}, "imu.csv"); }, ThrowsMessage<InputError>(HasSubstr(message)));
}

TEST(ImuCheck, FindsNothingInAGoodRecording) {
  const ImuCheck check = check_readings(recording(), {}, "imu.csv");
  EXPECT_NEAR(check.rate_hz, 200.0, 1e-6);
  EXPECT_TRUE(check.unusable.empty());
  EXPECT_TRUE(check.warnings.empty());
  EXPECT_TRUE(check.covers(0.0, 10.0));
}

TEST(ImuCheck, NamesWrongUnits) {
  auto samples = recording();
  for (geometry::ImuSample& sample : samples) sample.specific_force_m_s2 /= 9.80665;
  expect_refused(samples, "it is in g; give it in m/s^2");
  samples = recording();
  for (geometry::ImuSample& sample : samples) sample.specific_force_m_s2 *= 1e3 / 9.80665;
  expect_refused(samples, "far from gravity's 9.8 m/s^2: check its unit");
  samples = recording();
  for (geometry::ImuSample& sample : samples) sample.specific_force_m_s2 = 0.1 * Vec3::Random();
  expect_refused(samples, "gravity was taken from it");
}

TEST(ImuCheck, RefusesWhatIsNoRecording) {
  expect_refused({}, "fewer than two readings");
  auto samples = recording();
  samples[40].angular_rate_rad_s.y() = std::nan("");
  expect_refused(samples, "imu.csv: reading 41: has a number that is not finite");
  samples = recording();
  samples[40].time_s = samples[39].time_s;
  expect_refused(samples, "imu.csv: reading 41: its time is not after the one before it");
  samples = recording();
  for (geometry::ImuSample& sample : samples) sample = {sample.time_s, Vec3::Zero(), Vec3(0.0, 0.0, 9.8)};
  expect_refused(samples, "all readings are the same");
}

TEST(ImuCheck, GapsAreNamedAndLeftOut) {
  auto samples = recording();
  samples.erase(samples.begin() + 400, samples.begin() + 500);
  samples.erase(samples.begin() + 1000, samples.begin() + 1010);
  const ImuCheck check = check_readings(samples, {}, "imu.csv");
  ASSERT_EQ(check.warnings.size(), 1U);
  EXPECT_THAT(check.warnings[0].message, HasSubstr("readings stop 2 times, 0.56 s in all, first at 1.995 s"));
  EXPECT_TRUE(check.covers(0.0, 1.995));
  EXPECT_FALSE(check.covers(1.0, 2.0));
  EXPECT_FALSE(check.covers(2.1, 2.2));
  EXPECT_TRUE(check.covers(2.5, 5.0));
}

TEST(ImuCheck, FrozenReadingsAreNamedAndLeftOutUnlessTheUnitHasNoNoise) {
  auto samples = recording();
  for (std::size_t i = 601; i < 660; ++i) {
    samples[i].angular_rate_rad_s = samples[600].angular_rate_rad_s;
    samples[i].specific_force_m_s2 = samples[600].specific_force_m_s2;
  }
  const ImuCheck check = check_readings(samples, {}, "imu.csv");
  ASSERT_EQ(check.warnings.size(), 1U);
  EXPECT_THAT(check.warnings[0].message, HasSubstr("repeats the same reading 1 times"));
  EXPECT_FALSE(check.covers(3.1, 3.2));
  EXPECT_TRUE(check.covers(3.5, 9.0));
  EXPECT_TRUE(check_readings(samples, {0.0, 0.0, 0.0, 0.0}, "imu.csv").warnings.empty());
}

TEST(ImuCheck, SaturationIsNamedAndLeftOut) {
  auto samples = recording();
  for (std::size_t i = 800; i < 830; ++i) samples[i].specific_force_m_s2.x() = -19.6133;
  const ImuCheck check = check_readings(samples, {}, "imu.csv");
  ASSERT_EQ(check.warnings.size(), 1U);
  EXPECT_THAT(check.warnings[0].message, HasSubstr("saturates 1 times"));
  EXPECT_FALSE(check.covers(4.0, 4.1));
  EXPECT_TRUE(check.covers(4.2, 9.0));
}

}  // namespace
}  // namespace tileflight::inertial::imu_check_test
