#include "tileflight/capture/sensors/gnss.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tileflight/core/base/input_error.h"

namespace tileflight::sensors::gnss_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

Vec3 straight(double time_s) { return {3.0 * time_s, -1.0 * time_s, 100.0}; }

TEST(Gnss, WithoutErrorsItIsThePositionAtItsTime) {
  const GnssOptions perfect{.horizontal_sigma_m = 0,
                            .vertical_sigma_m = 0,
                            .horizontal_bias_sigma_m = 0,
                            .vertical_bias_sigma_m = 0,
                            .lag_s = 0.25};
  const auto fixes = simulate_gnss(straight, 2.0, 5.0, perfect);
  ASSERT_EQ(fixes.size(), 31U);
  for (const GnssFix& fix : fixes) EXPECT_LT((fix.position - straight(fix.time_s - 0.25)).norm(), 1e-12);
  EXPECT_DOUBLE_EQ(fixes.back().time_s, 5.0);
}

TEST(Gnss, NoiseAndBiasHaveTheirStatistics) {
  const GnssOptions options{.seed = 9,
                            .rate_hz = 20.0,
                            .horizontal_sigma_m = 0.3,
                            .vertical_sigma_m = 0.6,
                            .horizontal_bias_sigma_m = 1.5,
                            .vertical_bias_sigma_m = 2.0,
                            .bias_time_s = 5.0};
  const auto fixes = simulate_gnss([](double) { return Vec3(Vec3::Zero()); }, 0.0, 20000.0, options);
  const auto n = static_cast<double>(fixes.size());
  Vec3 variance = Vec3::Zero();
  Vec3 step_variance = Vec3::Zero();  // of the difference of neighbours: twice the noise, nearly free of the bias
  Vec3 lagged = Vec3::Zero();         // covariance at the bias's correlation time
  for (std::size_t i = 0; i + 100 < fixes.size(); ++i) {
    variance += fixes[i].position.cwiseAbs2() / n;
    step_variance += (fixes[i + 1].position - fixes[i].position).cwiseAbs2() / n;
    lagged += fixes[i].position.cwiseProduct(fixes[i + 100].position) / n;
  }
  EXPECT_NEAR(std::sqrt(variance.x()), std::hypot(0.3, 1.5), 0.08);
  EXPECT_NEAR(std::sqrt(variance.z()), fixes[0].vertical_sigma_m, 0.1);
  const double bias_step = 2.0 * 1.5 * 1.5 * (1.0 - std::exp(-1.0 / 100.0));
  EXPECT_NEAR(step_variance.y(), 2.0 * 0.09 + bias_step, 0.01);
  EXPECT_NEAR(lagged.x(), 1.5 * 1.5 * std::exp(-1.0), 0.15);
}

TEST(Gnss, TheSeedDecidesAndATrajectoryIsItsSpan) {
  geometry::Trajectory trajectory;
  trajectory.poses = {{1.0, {Eigen::Quaterniond::Identity(), Vec3(0, 0, 0)}},
                      {3.0, {Eigen::Quaterniond::Identity(), Vec3(20, 0, 0)}}};
  const auto a = simulate_gnss(trajectory, {.seed = 4, .lag_s = 0.3});
  const auto b = simulate_gnss(trajectory, {.seed = 4, .lag_s = 0.3});
  const auto c = simulate_gnss(trajectory, {.seed = 5, .lag_s = 0.3});
  ASSERT_EQ(a.size(), 21U);
  ASSERT_EQ(b.size(), a.size());
  ASSERT_EQ(c.size(), a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].position, b[i].position);
    EXPECT_NE(a[i].position, c[i].position);
    EXPECT_NEAR(a[i].position.x(), std::max(0.0, 10.0 * (a[i].time_s - 1.3)), 4.0);
  }
}

TEST(Gnss, RefusesImpossibleOptions) {
  EXPECT_THAT([&] { simulate_gnss(straight, 0, 1, {.rate_hz = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("GNSS rate: must lie between 0 and 1000 Hz")));
  EXPECT_THAT([&] { simulate_gnss(straight, 0, 1, {.vertical_sigma_m = -1.0}); },
              ThrowsMessage<InputError>(HasSubstr("GNSS noise: must not be negative")));
  EXPECT_THAT([&] { simulate_gnss(straight, 0, 1, {.bias_time_s = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("GNSS bias time: must be positive")));
  EXPECT_THAT([&] { simulate_gnss(straight, 1, 0); },
              ThrowsMessage<InputError>(HasSubstr("GNSS time span: ends before it starts")));
  EXPECT_THAT([&] { simulate_gnss(geometry::Trajectory{}); },
              ThrowsMessage<InputError>(HasSubstr("GNSS: the trajectory has no poses")));
}

}  // namespace
}  // namespace tileflight::sensors::gnss_test
