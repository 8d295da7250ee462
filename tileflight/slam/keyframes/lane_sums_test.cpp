#include "tileflight/slam/keyframes/lane_sums.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace tileflight::keyframes::lane_sums_test {
namespace {

TEST(LaneSums, AreTheSumsOfEachToTheBit) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F), exponent(-12.0F, 12.0F);
  for (int i = 0; i < 1000; ++i) {
    std::array<base::Float8, 4> values;
    for (base::Float8& value : values) {
      for (int k = 0; k < base::kLanes; ++k) value[k] = std::exp2(exponent(random)) * unit(random);
    }
    base::Float4 sums;
    sum_lanes(values[0], values[1], values[2], values[3], sums);
    for (int j = 0; j < 4; ++j) EXPECT_EQ(sums[j], base::horizontal_sum(values[j]));
  }
}

}  // namespace
}  // namespace tileflight::keyframes::lane_sums_test
