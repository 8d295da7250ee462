#include "tileflight/world/ground_truth/suggested_voxel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace tileflight::ground_truth::suggested_voxel_test {
namespace {

using geometry::Vec3;
using testing::HasSubstr;

TEST(SuggestedVoxel, IsThePublishedMetreForAPlaceOfThatSize) {
  EXPECT_DOUBLE_EQ(suggest_voxel_m({250, 250, 60}), 1.0);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({5000, 3000, 60}), 1.0) << "a city too: the metre is what readers compare with";
}

TEST(SuggestedVoxel, IsFinerForSmallThings) {
  EXPECT_DOUBLE_EQ(suggest_voxel_m({8, 6, 20}), 0.1);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({15, 12, 6}), 0.05);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({120, 90, 10}), 0.5);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({1, 1, 1}), 0.005);
  EXPECT_DOUBLE_EQ(suggest_voxel_m({0, 0, 0}), 0.001);
}

TEST(SuggestedVoxel, IsOneTwoOrFiveTimesAPowerOfTen) {
  for (double side_m = 0.3; side_m < 300; side_m *= 1.07) {
    const double edge_m = suggest_voxel_m({side_m, 0.5 * side_m, 0.1 * side_m});
    const double digit = edge_m / std::pow(10.0, std::floor(std::log10(edge_m) + 1e-9));
    EXPECT_TRUE(std::abs(digit - 1) < 1e-9 || std::abs(digit - 2) < 1e-9 || std::abs(digit - 5) < 1e-9) << edge_m;
    EXPECT_LT(std::abs(std::log(side_m / edge_m / 250)), std::log(1.6)) << side_m;
    EXPECT_FALSE(coarse_voxel_warning({side_m, 0.5 * side_m, 0.1 * side_m}, edge_m)) << side_m;
  }
}

TEST(SuggestedVoxel, AMetreOnAStatueIsSaidToBeCoarse) {
  const auto line = coarse_voxel_warning({8, 6, 20.26}, 1.0);
  ASSERT_TRUE(line);
  EXPECT_THAT(*line, HasSubstr("voxels of 1 m are coarse for a surface of 8 x 6 x 20.3 m"));
  EXPECT_THAT(*line, HasSubstr("use --voxel 0.1"));
  EXPECT_FALSE(coarse_voxel_warning({8, 6, 20.26}, 0.1));
  EXPECT_FALSE(coarse_voxel_warning({250, 250, 60}, 1.0));
  EXPECT_FALSE(coarse_voxel_warning({0, 0, 0}, 1.0));
}

}  // namespace
}  // namespace tileflight::ground_truth::suggested_voxel_test
