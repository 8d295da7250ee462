#include "tileflight/core/base/random_numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace tileflight::base::random_numbers_test {
namespace {

TEST(RandomNumbers, LogarithmOfLanesIsTheLibrarys) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any_exponent(-24.0F, 0.0F);
  for (int i = 0; i < 200'000; ++i) {
    Float8 x, logarithms;
    for (int lane = 0; lane < kLanes; ++lane) x[lane] = std::exp2(any_exponent(random));
    if (i == 0) x = Float8{0x1p-24F, 1.0F, 1.0F - 0x1p-24F, 0.70710677F, 0.70710683F, 0.5F, 0x1.fffffep-2F, 0x1p-23F};
    logarithm(x, logarithms);
    for (int lane = 0; lane < kLanes; ++lane) {
      const double expected = std::log(static_cast<double>(x[lane]));
      ASSERT_NEAR(logarithms[lane], expected, 2e-7 * std::max(1.0, std::abs(expected))) << x[lane];
    }
  }
}

TEST(RandomNumbers, CosineAndSineOfLanesAreTheLibrarys) {
  constexpr int kTurn = 1 << 24;
  for (int first = 0; first < kTurn; first += 8 * 37) {
    Int8 angle;
    for (int lane = 0; lane < kLanes; ++lane) angle[lane] = std::min(first + 37 * lane, kTurn - 1);
    Float8 cosine, sine;
    cosine_and_sine(angle, cosine, sine);
    for (int lane = 0; lane < kLanes; ++lane) {
      const double angle_rad = 2.0 * std::numbers::pi * angle[lane] / kTurn;
      ASSERT_NEAR(cosine[lane], std::cos(angle_rad), 2e-7) << angle[lane];
      ASSERT_NEAR(sine[lane], std::sin(angle_rad), 2e-7) << angle[lane];
    }
  }
}

TEST(RandomNumbers, NormalNumbersOfLanesAreThoseOneByOne) {
  double sum = 0.0, squares = 0.0, fourths = 0.0, products = 0.0;
  constexpr std::uint64_t kFirst = (1ULL << 40U) - 100'000, kCount = 800'000;
  for (std::uint64_t first = kFirst; first < kFirst + kCount; first += kLanes) {
    std::array<Float8, 4> lanes;
    normal_variates8(7, first, lanes);
    for (int lane = 0; lane < kLanes; ++lane) {
      const std::array<float, 4> expected = normal_variates(7, first + static_cast<std::uint64_t>(lane));
      for (std::size_t i = 0; i < 4; ++i) {
        const double normal = lanes[i][lane];
        ASSERT_NEAR(normal, expected[i], 4e-6) << first << " " << lane << " " << i;
        sum += normal;
        squares += normal * normal;
        fourths += normal * normal * normal * normal;
      }
      products += static_cast<double>(lanes[0][lane]) * lanes[1][lane];
    }
  }
  const double n = 4.0 * kCount;  // sigmas: of the mean 1, the variance sqrt(2), the fourth moment sqrt(96)
  EXPECT_NEAR(sum / n, 0.0, 4.0 / std::sqrt(n));
  EXPECT_NEAR(squares / n, 1.0, 4.0 * std::sqrt(2.0 / n));
  EXPECT_NEAR(fourths / n, 3.0, 4.0 * std::sqrt(96.0 / n));
  EXPECT_NEAR(products / kCount, 0.0, 4.0 / std::sqrt(static_cast<double>(kCount)));
}

}  // namespace
}  // namespace tileflight::base::random_numbers_test
