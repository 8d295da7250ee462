#include "tileflight/capture/vehicle/wind.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace tileflight::vehicle::wind_test {
namespace {

using geometry::Vec3;

/// Gusts in the axes along the wind, across it, up, at points `step_m` apart.
std::vector<Vec3> gusts(double step_m, int count, std::uint64_t seed = 1) {
  const WindOptions options{{0, 5, 0}, Turbulence::kModerate, 20.0, seed};  // air moves north
  Wind wind(options);
  std::vector<Vec3> result;
  for (int i = 0; i < count; ++i) {
    const Vec3 g = wind.velocity_m_s() - options.mean_m_s;
    result.emplace_back(g.y(), -g.x(), g.z());
    wind.advance(step_m / 10.0, Vec3(0, -5, 0));  // 10 m/s through the air
  }
  return result;
}

double correlation(const std::vector<Vec3>& g, int axis, std::size_t lag) {
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i + lag < g.size(); ++i) {
    sum += g[i][axis] * g[i + lag][axis];
    squares += g[i][axis] * g[i][axis];
  }
  return sum / squares;
}

TEST(Wind, WithoutTurbulenceIsItsMean) {
  Wind wind({{1, 2, 3}, Turbulence::kNone, 20.0, 1});
  wind.advance(1.0, Vec3(4, 5, 6));
  EXPECT_EQ(wind.velocity_m_s(), Vec3(1, 2, 3));
}

TEST(Wind, AnotherMeanHoldsFromThenOnAndTurnsTheGusts) {
  Wind calm({{1, 2, 3}, Turbulence::kNone, 20.0, 1});
  calm.set_mean({0, -7, 0});
  EXPECT_EQ(calm.velocity_m_s(), Vec3(0, -7, 0));
  Wind gusty({{5, 0, 0}, Turbulence::kModerate, 20.0, 1});
  const Vec3 gust = gusty.velocity_m_s() - Vec3(5, 0, 0);
  gusty.set_mean({0, 5, 0});
  const Vec3 turned = gusty.velocity_m_s() - Vec3(0, 5, 0);
  EXPECT_NEAR((turned - Vec3(-gust.y(), gust.x(), gust.z())).norm(), 0.0, 1e-12);
}

TEST(Wind, ScalesAreThoseOfTheMilitarySpecification) {
  // Computed by hand from MIL-F-8785C at 100 ft, light: W20 = 15 kn, 0.177 + 0.0823 = 0.2593.
  const GustScales scales = gust_scales(Turbulence::kLight, 30.48);
  EXPECT_NEAR(scales.sigma_m_s.z(), 0.771666, 1e-5);
  EXPECT_NEAR(scales.sigma_m_s.x(), 0.771666 / std::pow(0.2593, 0.4), 1e-5);
  EXPECT_NEAR(scales.length_m.x(), 30.48 / std::pow(0.2593, 1.2), 1e-9);
  EXPECT_NEAR(scales.length_m.z(), 30.48, 1e-9);
  const GustScales high = gust_scales(Turbulence::kSevere, 304.8);  // where the three are nearly equal
  EXPECT_NEAR(high.sigma_m_s.x(), high.sigma_m_s.z(), 1e-9);
  EXPECT_NEAR(high.length_m.x(), high.length_m.z(), 1e-9);
}

TEST(Wind, GustsHaveDrydensVariancesAndCorrelations) {
  const GustScales scales = gust_scales(Turbulence::kModerate, 20.0);
  for (int axis = 0; axis < 3; ++axis) {
    const double step_m = scales.length_m[axis] / 10.0;
    const std::vector<Vec3> g = gusts(step_m, 120000);
    double sum = 0, squares = 0;
    for (const Vec3& v : g) {
      sum += v[axis];
      squares += v[axis] * v[axis];
    }
    const double n = static_cast<double>(g.size()), sigma = scales.sigma_m_s[axis];
    EXPECT_NEAR(sum / n, 0.0, 0.04 * sigma);  // over some 10^4 length scales
    EXPECT_NEAR(std::sqrt(squares / n), sigma, 0.03 * sigma);
    for (const int lag : {5, 10, 20}) {  // exp(-r/L) along, exp(-r/L) (1 - r/2L) across: Dryden's correlations
      const double r = lag / 10.0, expected = std::exp(-r) * (axis == 0 ? 1.0 : 1.0 - r / 2.0);
      EXPECT_NEAR(correlation(g, axis, lag), expected, 0.03) << "axis " << axis << " lag " << lag;
    }
  }
}

TEST(Wind, ShortStepsGiveTheSameStatisticsAsLongOnes) {
  const GustScales scales = gust_scales(Turbulence::kModerate, 20.0);
  const double step_m = scales.length_m.z() / 500.0;
  const std::vector<Vec3> g = gusts(step_m, 300000);
  EXPECT_NEAR(correlation(g, 2, 250), std::exp(-0.5) * 0.75, 0.08);
  // A transverse gust has R = exp(-r)(1 - r/2), so E (difference)^2 = 2 sigma^2 (1 - R) = 3 sigma^2 r for small r.
  double difference = 0;
  for (std::size_t i = 1; i < g.size(); ++i) difference += std::pow(g[i].z() - g[i - 1].z(), 2);
  EXPECT_NEAR(difference / static_cast<double>(g.size()) / std::pow(scales.sigma_m_s.z(), 2), 3.0 / 500.0, 1e-4);
}

TEST(Wind, IsAFunctionOfItsSeed) {
  EXPECT_EQ(gusts(1.0, 50, 7), gusts(1.0, 50, 7));
  EXPECT_NE(gusts(1.0, 50, 7), gusts(1.0, 50, 8));
}

}  // namespace
}  // namespace tileflight::vehicle::wind_test
