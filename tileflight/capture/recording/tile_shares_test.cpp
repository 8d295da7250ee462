#include "tileflight/capture/recording/tile_shares.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace tileflight::recording::tile_shares_test {
namespace {

using geometry::Vec3;

/// Tiles of random sizes all over a place of 2 km x 1 km.
std::vector<TileWork> random_tiles(std::size_t count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> x(-1000, 1000), y(-500, 500), z(0, 40), cost(1, 3);
  std::vector<TileWork> tiles;
  for (std::size_t i = 0; i < count; ++i) tiles.push_back({Vec3(x(random), y(random), z(random)), cost(random)});
  return tiles;
}

std::vector<double> costs_of(const std::vector<TileWork>& tiles, const std::vector<std::size_t>& share_of,
                             std::size_t shares, const auto& counts) {
  std::vector<double> costs(shares, 0.0);
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    EXPECT_LT(share_of[i], shares);
    if (counts(tiles[i])) costs[share_of[i]] += tiles[i].cost;
  }
  return costs;
}

TEST(TileShares, AreOfTheSameCostEverywhere) {
  const std::vector<TileWork> tiles = random_tiles(6000);
  for (const std::size_t shares : {1U, 2U, 3U, 4U, 7U}) {
    const std::vector<std::size_t> share_of = deal_tiles(tiles, shares);
    const auto expect_even = [&](const auto& counts, double slack) {
      const std::vector<double> costs = costs_of(tiles, share_of, shares, counts);
      const double mean = std::accumulate(costs.begin(), costs.end(), 0.0) / static_cast<double>(shares);
      EXPECT_LT(std::ranges::max(costs), (1.0 + slack) * mean) << shares;
      EXPECT_GT(std::ranges::min(costs), (1.0 - slack) * mean) << shares;
    };
    expect_even([](const TileWork&) { return true; }, 0.03);
    // What a frame in a corner sees of the place.
    expect_even([](const TileWork& tile) { return tile.center.x() > 0.0 && tile.center.y() > 0.0; }, 0.5);
  }
}

TEST(TileShares, ConsistOfFewCompactPieces) {
  const std::vector<TileWork> tiles = random_tiles(4000);
  const std::vector<std::size_t> share_of = deal_tiles(tiles, 4);
  std::size_t of_the_same = 0;
  for (std::size_t i = 0; i < tiles.size(); ++i) {
    std::size_t nearest = i == 0 ? 1 : 0;
    for (std::size_t k = 0; k < tiles.size(); ++k) {
      const auto distance = [&](std::size_t other) { return (tiles[other].center - tiles[i].center).norm(); };
      if (k != i && distance(k) < distance(nearest)) nearest = k;
    }
    of_the_same += share_of[nearest] == share_of[i] ? 1 : 0;
  }
  EXPECT_GT(of_the_same, tiles.size() * 9 / 10) << "a tile and the nearest to it mostly belong to one share";
}

TEST(TileShares, HoldWhatHasNoCostOrNoExtent) {
  EXPECT_TRUE(deal_tiles({}, 3).empty());
  const std::vector<TileWork> without_cost(5, {Vec3(1, 2, 3), 0.0});
  for (const std::size_t share : deal_tiles(without_cost, 3)) EXPECT_LT(share, 3U);
  const std::vector<TileWork> at_one_place(48, {Vec3(1, 2, 3), 1.0});
  const auto all = [](const TileWork&) { return true; };
  for (const double cost : costs_of(at_one_place, deal_tiles(at_one_place, 3), 3, all)) EXPECT_EQ(cost, 16.0);
}

TEST(TileShares, AreWorthItWhereProcessesWouldReadTheSame) {
  // Four processes, frames of a quarter of a megapixel.
  SharingCosts costs{.frames_dealt_bytes = 100e6, .tiles_dealt_bytes = 100e6, .pixels = 20 * 0.25e6, .processes = 4};
  EXPECT_FALSE(costs.is_tiles_better()) << "a survey, of whose tiles each process needs its own";
  costs.frames_dealt_bytes = 300e6;
  EXPECT_TRUE(costs.is_tiles_better()) << "a crossing, each frame of which shows half of the place";
  costs.pixels = 2000 * 0.25e6;
  EXPECT_FALSE(costs.is_tiles_better()) << "many frames, all of which would have to be exchanged";
}

TEST(TileShares, UsesTravelAsBytes) {
  const TileUses uses{0, 3, 4000000000U};
  EXPECT_EQ(uses_from_bytes(to_bytes(uses)), uses);
  EXPECT_TRUE(uses_from_bytes(to_bytes({})).empty());
}

}  // namespace
}  // namespace tileflight::recording::tile_shares_test
