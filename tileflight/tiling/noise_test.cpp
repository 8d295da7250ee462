#include "tileflight/tiling/noise.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace tileflight::tiling {
namespace {

TEST(Noise, IsFixedForAllTimesAndMachines) {
  // Written down once: the built-in place's bytes hang on these.
  EXPECT_EQ(mix_bits(1), 0x514e28b7U);
  EXPECT_EQ(hash_lattice(0, 0, 0), 0U);
  EXPECT_EQ(hash_lattice(-3, 7, 11),
            mix_bits((static_cast<std::uint32_t>(-3) * 0x9e3779b1U + 11U) ^ (7U * 0x7feb352dU)));
}

TEST(Noise, FloorMatchesTheLibrary) {
  for (const double x : {-2.0, -1.5, -1e-9, 0.0, 0.25, 1.0, 1.999, 12345.6})
    EXPECT_EQ(floor_to_int(x), static_cast<int>(std::floor(x))) << x;
}

TEST(Noise, IsContinuousAndBounded) {
  for (int i = 0; i < 2000; ++i) {
    const double x = 0.037 * i - 31, y = 0.051 * i - 17;
    EXPECT_LE(std::fabs(value_noise(x, y, 5)), 1.0F);
    EXPECT_NEAR(value_noise(x, y, 5), value_noise(x + 1e-4, y, 5), 1e-3);
    EXPECT_NEAR(value_noise_3d(x, y, 0.3, 5), value_noise_3d(x, y, 0.3 + 1e-4, 5), 1e-3);
  }
}

TEST(Noise, HasTheHashOfTheLatticeAtIntegers) {
  for (int x = -3; x < 4; ++x)
    for (int y = -3; y < 4; ++y) {
      const auto signed_hash = static_cast<std::int32_t>(hash_lattice(x, y, 21));
      EXPECT_EQ(value_noise(x, y, 21), static_cast<float>(signed_hash) * 0x1p-31F);
    }
}

TEST(Noise, HitsItsLatticeAndVariesBetweenSeeds) {
  EXPECT_EQ(value_noise(3.0, 4.0, 9), value_noise(3.0 + 1e-12, 4.0, 9));
  int equal = 0;
  for (int i = 0; i < 100; ++i) equal += value_noise(i, 2 * i, 1) == value_noise(i, 2 * i, 2);
  EXPECT_LT(equal, 3);
}

TEST(Noise, FractalHasMeanZeroAndTheDeviationThatPhotogrammetryCountsOn) {
  double sum = 0, squares = 0;
  constexpr int kCount = 40000;
  for (int i = 0; i < kCount; ++i) {
    const double v = fractal_noise_3d(0.731 * (i % 200), 0.577 * (i / 200), 0.619 * (i % 37), 3, 3);
    sum += v;
    squares += v * v;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.03);
  EXPECT_NEAR(std::sqrt(squares / kCount), 0.38, 0.05);
}

TEST(Noise, RandomIsUniform) {
  Random random(7);
  std::array<int, 10> counts{};
  for (int i = 0; i < 100000; ++i) ++counts[static_cast<std::size_t>(random.uniform() * 10)];
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);  // four standard deviations
}

}  // namespace
}  // namespace tileflight::tiling
