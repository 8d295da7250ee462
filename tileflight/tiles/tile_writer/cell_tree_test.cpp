#include "tileflight/tiles/tile_writer/cell_tree.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tileflight/core/base/noise.h"

namespace tileflight::tile_writer::cell_tree_test {
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

TEST(CellTree, CellsSplitOneByOneAreThoseOfTheWhole) {
  std::vector<Vec3> places;
  std::vector<float> weights;
  for (int i = 0; i < 2000; ++i) {
    places.emplace_back(100 * base::value_noise(0.37 * i, 1.0, 1), 30 * base::value_noise(0.53 * i, 2.0, 2), 0.1 * i);
    weights.push_back(i % 3 == 0 ? 5.0F : 1.0F);
  }
  const CellTree whole(places, weights, 3);
  CellTree parts(3);
  const auto quarters = parts.split(0, 0, 1, places, weights);
  for (std::uint32_t cell = 0; cell < 4; ++cell) {
    std::vector<Vec3> own;
    std::vector<float> own_weights;
    for (const std::uint32_t item : quarters[cell]) {
      EXPECT_EQ(parts.cell_of(places[item], 1), cell);
      own.push_back(places[item]);
      own_weights.push_back(weights[item]);
    }
    const auto leaves = parts.split(cell, 1, 3, own, own_weights);
    ASSERT_EQ(leaves.size(), 16U);
    for (std::uint32_t i = 0; i < 16; ++i) {
      std::vector<std::uint32_t> items;
      for (const std::uint32_t item : leaves[i]) items.push_back(quarters[cell][item]);
      EXPECT_EQ(items, whole.leaves()[16 * cell + i]);
    }
  }
  for (const Vec3& place : places) {
    EXPECT_EQ(parts.cell_of(place, 3), whole.cell_of(place, 3));
    EXPECT_EQ(parts.cell_of(place, 3, 2, 1) / 16, 2U) << "among the descendants of cell 2, wherever the point is";
  }
}

TEST(CellTree, ManyItemsAtOnePlaceAreStillSharedOut) {
  const CellTree tree(std::vector<Vec3>(100, Vec3::Ones()), std::vector<float>(100, 1.0F), 1);
  ASSERT_EQ(tree.leaves().size(), 4U);
  for (const auto& leaf : tree.leaves()) EXPECT_EQ(leaf.size(), 25U);
  EXPECT_EQ(CellTree({}, {}, 2).leaves().size(), 16U);
}

}  // namespace
}  // namespace tileflight::tile_writer::cell_tree_test
