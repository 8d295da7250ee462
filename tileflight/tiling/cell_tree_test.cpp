#include "tileflight/tiling/cell_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tileflight/base/noise.h"

namespace tileflight::tiling::cell_tree_test {
namespace {

using geometry::Vec3;

TEST(CellTree, SharesWeightOutEvenlyAndFindsEachItemAgain) {
  std::vector<Vec3> places;
  std::vector<float> weights;
  for (int i = 0; i < 3000; ++i) {
    const double x = base::value_noise(0.37 * i, 1.0, 1), y = base::value_noise(0.53 * i, 2.0, 2),
                 z = base::value_noise(0.71 * i, 3.0, 3);
    places.emplace_back(100 * x, 30 * y, 10 * z);
    weights.push_back(i % 3 == 0 ? 5.0F : 1.0F);
  }
  const CellTree tree(places, weights, 3);
  ASSERT_EQ(tree.leaves().size(), 64U);
  std::vector<int> uses(places.size());
  const double mean = 7000.0 / 64;
  for (std::uint32_t leaf = 0; leaf < 64; ++leaf) {
    double weight = 0;
    for (const std::uint32_t item : tree.leaves()[leaf]) {
      ++uses[item];
      weight += static_cast<double>(weights[item]);
      for (int level = 0; level <= 3; ++level) EXPECT_EQ(tree.cell_of(places[item], level), leaf >> (2 * (3 - level)));
    }
    EXPECT_NEAR(weight, mean, 15);
    EXPECT_TRUE(std::is_sorted(tree.leaves()[leaf].begin(), tree.leaves()[leaf].end()));
  }
  EXPECT_EQ(uses, std::vector<int>(places.size(), 1));
}

TEST(CellTree, ManyItemsAtOnePlaceAreStillSharedOut) {
  const CellTree tree(std::vector<Vec3>(100, Vec3::Ones()), std::vector<float>(100, 1.0F), 1);
  ASSERT_EQ(tree.leaves().size(), 4U);
  for (const auto& leaf : tree.leaves()) EXPECT_EQ(leaf.size(), 25U);
  EXPECT_EQ(CellTree({}, {}, 2).leaves().size(), 16U);
}

}  // namespace
}  // namespace tileflight::tiling::cell_tree_test
