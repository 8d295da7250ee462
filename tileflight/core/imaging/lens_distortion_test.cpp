#include "tileflight/core/imaging/lens_distortion.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace tileflight::imaging::polynomial_test {
namespace {

TEST(Polynomial, Value) {
  const std::array<double, 4> c{1.0, -2.0, 0.0, 3.0};
  EXPECT_DOUBLE_EQ(evaluate_polynomial(c, 2.0), 1.0 - 4.0 + 24.0);
}

TEST(Polynomial, FirstRootAgreesWithADenseScan) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> coefficient(-1.0, 1.0);
  constexpr double kUpper = 10.0;
  constexpr int kSteps = 100000;
  for (int i = 0; i < 50; ++i) {
    const std::array<double, 5> c{1.0, coefficient(random), coefficient(random), coefficient(random),
                                  coefficient(random)};
    double scanned = -1.0;
    for (int s = 1; s <= kSteps && scanned < 0.0; ++s)
      if (evaluate_polynomial(c, kUpper * s / kSteps) <= 0.0) scanned = kUpper * s / kSteps;
    const auto found = first_nonpositive(c, kUpper);
    ASSERT_EQ(found.has_value(), scanned > 0.0);
    if (found.has_value()) {
      EXPECT_NEAR(*found, scanned, kUpper / kSteps);
    }
  }
}

TEST(Polynomial, TwoCloseRootsAreNotMissed) {
  // (x - 1)(x - 1 - 1e-6): negative only on a millionth.
  const std::array<double, 3> c{1.0 + 1e-6, -2.0 - 1e-6, 1.0};
  const auto found = first_nonpositive(c, 3.0);
  ASSERT_TRUE(found.has_value());
  EXPECT_NEAR(*found, 1.0, 1e-8);
}

TEST(Polynomial, ZeroHighCoefficients) {
  const std::array<double, 5> c{1.0, -0.5, 0.0, 0.0, 0.0};
  EXPECT_DOUBLE_EQ(first_nonpositive(c, 3.0).value(), 2.0);
  const std::array<double, 5> constant{1.0, 0.0, 0.0, 0.0, 0.0};
  EXPECT_FALSE(first_nonpositive(constant, 3.0).has_value());
}

}  // namespace
}  // namespace tileflight::imaging::polynomial_test
