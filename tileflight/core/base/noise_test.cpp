#include "tileflight/core/base/noise.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <utility>

namespace tileflight::base::noise_test {
namespace {

TEST(Noise, IsFixedForAllTimesAndMachines) {
  // Reference values: the built-in site's bytes depend on them.
  EXPECT_EQ(murmur3_mix(1), 0x514e28b7U);
  EXPECT_EQ(hash_lattice(0, 0, 0), 0U);
  EXPECT_EQ(hash_lattice(-3, 7, 11), 0xa9181214U);
  EXPECT_EQ(hash_lattice(1, 0, 0), 0xc80d83e3U);
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

TEST(Noise, FractalIsTheSumOfItsOctavesToTheLastBit) {
  for (int octaves = 1; octaves <= 9; ++octaves) {
    for (int i = 0; i < 300; ++i) {
      double x = 0.731 * (i - 150), y = -3.577 * i + 11.0;
      const std::uint32_t seed = 7U + static_cast<std::uint32_t>(i);
      const double x0 = x, y0 = y;
      const float gain = i % 2 == 0 ? 0.5F : 0.6F;
      double z = 0.37 * i - 20.0;
      const double z0 = z;
      float sum = 0.0F, sum_3d = 0.0F, weight = 1.0F, total = 0.0F;
      for (std::uint32_t octave = 0; octave < static_cast<std::uint32_t>(octaves); ++octave) {
        sum += weight * value_noise(x, y, seed + 0x632be5abU * octave);
        sum_3d += weight * value_noise_3d(x, y, z, seed + 0x632be5abU * octave);
        total += weight;
        weight *= gain;
        x = 2.0 * x + 17.3;
        y = 2.0 * y + 5.7;
        z = 2.0 * z + 11.1;
      }
      ASSERT_EQ(fractal_noise(x0, y0, seed, octaves, gain), 1.6F * sum / total) << octaves << " " << i;
      ASSERT_EQ(fractal_noise_3d(x0, y0, z0, seed, octaves, gain), 1.6F * sum_3d / total) << octaves << " " << i;
    }
  }
}

TEST(Noise, FractalHasMeanZeroAndTheDeviationThatPhotogrammetryCountsOn) {
  double sum = 0, squares = 0;
  constexpr int kCount = 40000;
  for (int i = 0; i < kCount; ++i) {
    const int column = i % 200, row = i / 200;
    const double v = fractal_noise_3d(0.731 * column, 0.577 * row, 0.619 * (i % 37), 3, 3);
    sum += v;
    squares += v * v;
  }
  EXPECT_NEAR(sum / kCount, 0.0, 0.03);
  EXPECT_NEAR(std::sqrt(squares / kCount), 0.38, 0.05);
}

TEST(Noise, NeighboursOnTheLatticeAreUncorrelated) {
  for (const auto& [dx, dy] : {std::pair{1, 0}, std::pair{0, 1}, std::pair{1, 1}, std::pair{2, 0}}) {
    double products = 0, squares = 0;
    for (int y = -100; y < 100; ++y) {
      for (int x = -100; x < 100; ++x) {
        const double a = cell_random(x, y, 5) - 0.5, b = cell_random(x + dx, y + dy, 5) - 0.5;
        products += a * b;
        squares += a * a;
      }
    }
    EXPECT_NEAR(products / squares, 0.0, 0.025) << dx << dy;  // five standard deviations
    EXPECT_NEAR(squares / 40000, 1.0 / 12, 0.002);
  }
}

TEST(Noise, RandomIsUniform) {
  HashRandom random(7);
  std::array<int, 10> counts{};
  for (int i = 0; i < 100000; ++i) ++counts[static_cast<std::size_t>(random.uniform() * 10)];
  for (const int count : counts) EXPECT_NEAR(count, 10000, 400);  // four standard deviations
}

}  // namespace
}  // namespace tileflight::base::noise_test
