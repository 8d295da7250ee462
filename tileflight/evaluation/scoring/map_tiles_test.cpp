#include "tileflight/evaluation/scoring/map_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "tests/temporary_folder.h"
#include "tileflight/core/alignment/normals.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/voxel_wasserstein.h"
#include "tileflight/evaluation/scoring/tiled_scores.h"

namespace tileflight::scoring::map_tiles_test {
namespace {

using geometry::Box3;
using geometry::PointCloud;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// A bumpy sheet with noise, some points twice, others far away: a single outlier takes up most of the octree.
PointCloud sheet(std::size_t points) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> place(0.0, 20.0), far(-400.0, 900.0);
  std::normal_distribution<double> noise(0.0, 0.05);
  PointCloud cloud;
  while (cloud.size() < points) {
    const double x = place(random), y = place(random);
    cloud.positions.emplace_back(x, y, std::sin(x) * std::cos(y) + noise(random));
    if (cloud.size() % 10 == 0) cloud.positions.push_back(cloud.positions[cloud.size() / 2]);
    if (cloud.size() % 97 == 0) cloud.positions.emplace_back(far(random), far(random), far(random));
  }
  cloud.positions.resize(points);
  return cloud;
}

/// On a lattice: many neighbours are equally far.
PointCloud lattice(int side) {
  PointCloud cloud;
  for (int i = 0; i < side * side * side; ++i)
    cloud.positions.emplace_back(0.5 * (i % side), 0.5 * (i / side % side), 0.5 * (i / side / side));
  std::shuffle(cloud.positions.begin(), cloud.positions.end(), std::mt19937(3));
  return cloud;
}

const geometry::Sim3 kPlaced{1.3, geometry::Sim3().rotation* Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()),
                             Vec3(5, -3, 2)};

struct Tiled {
  Tiled(const PointCloud& cloud, std::size_t most, const std::vector<bool>* chosen = nullptr)
      : whole(geometry::transformed(kPlaced, cloud)),
        tiles(MapPoints(cloud), kPlaced, folder.path(), {.chosen = chosen, .most_points = most}) {}

  PointCloud whole;
  tests::TemporaryFolder folder;
  MapTiles tiles;
};

TEST(MapTiles, HoldEachPointOnceInTheOrderOfTheMap) {
  const PointCloud cloud = sheet(5000);
  for (const std::size_t most : {60, 700, 5000}) {
    const Tiled tiled(cloud, most);
    EXPECT_EQ(tiled.tiles.size() > 1, most < 5000) << most;
    EXPECT_TRUE(std::filesystem::is_empty(tiled.folder.path())) << "the file has no name";
    std::vector<std::uint32_t> all;
    for (std::size_t tile = 0; tile < tiled.tiles.size(); ++tile) {
      const MapTiles::Points points = tiled.tiles.read(tile);
      EXPECT_LE(points.numbers.size(), most);
      EXPECT_TRUE(std::ranges::is_sorted(points.numbers));
      for (std::size_t i = 0; i < points.numbers.size(); ++i) {
        EXPECT_EQ(points.positions[i], tiled.whole.positions[points.numbers[i]]);
        EXPECT_TRUE(tiled.tiles.bounds()[tile].contains(points.positions[i]));
      }
      all.insert(all.end(), points.numbers.begin(), points.numbers.end());
    }
    std::ranges::sort(all);
    std::vector<std::uint32_t> expected(5000);
    std::iota(expected.begin(), expected.end(), 0U);
    EXPECT_EQ(all, expected) << most;
  }
}

TEST(MapTiles, SampleAsTheWholeMapDoes) {
  const PointCloud cloud = sheet(5000);
  for (const std::size_t most : {60, 700, 5000}) {
    const Tiled tiled(cloud, most);
    for (const std::size_t count : {1, 7, 256, 4999, 5000, 6000}) {
      const MapTiles::Points sampled = tiled.tiles.at(tiled.tiles.sample_evenly(count));
      EXPECT_EQ(sampled.numbers, geometry::sample_evenly(tiled.whole.positions, count)) << most << " " << count;
    }
  }
}

TEST(MapTiles, OfChosenPointsAlone) {
  const PointCloud cloud = sheet(3000);
  std::vector<bool> chosen(3000);
  std::vector<std::uint32_t> numbers;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    chosen[i] = i % 3 != 1;
    if (chosen[i]) numbers.push_back(static_cast<std::uint32_t>(i));
  }
  const Tiled tiled(cloud, 100, &chosen);
  EXPECT_EQ(tiled.tiles.points(), numbers.size());
  std::vector<std::uint32_t> expected;
  for (const std::uint32_t i : geometry::sample_evenly(geometry::filter_points(tiled.whole, chosen).positions, 500))
    expected.push_back(numbers[i]);
  EXPECT_EQ(tiled.tiles.at(tiled.tiles.sample_evenly(500)).numbers, expected);
}

TEST(MapTiles, ReadWhatIsInABox) {
  const Tiled tiled(sheet(5000), 60);
  const Box3 box(Vec3(5, 0, -5), Vec3(20, 15, 20));
  std::vector<std::uint32_t> expected;
  for (std::size_t i = 0; i < tiled.whole.size(); ++i) {
    if (box.contains(tiled.whole.positions[i])) expected.push_back(static_cast<std::uint32_t>(i));
  }
  ASSERT_GT(expected.size(), 100U);
  EXPECT_EQ(tiled.tiles.read_within(box).numbers, expected);
}

TEST(MapTiles, OfManyPointsInOnePlace) {
  const Tiled tiled(PointCloud{std::vector<Vec3>(500, Vec3(1, 2, 3)), {}, {}, {}}, 60);
  EXPECT_EQ(tiled.tiles.size(), 1U) << "one cell cannot be split";
  EXPECT_EQ(tiled.tiles.read(0).numbers.size(), 500U);
}

TEST(MapTiles, SayWhereTheyCannotBeStored) {
  EXPECT_THAT([] { MapTiles(MapPoints(sheet(200)), kPlaced, "/no/such/folder", {.most_points = 60}); },
              ThrowsMessage<InputError>(HasSubstr("/no/such/folder: the map's points cannot be stored there")));
}

TEST(MapPoints, OfALargeFileAreReadInBlocks) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = sheet(1000);
  geometry::write_cloud(folder / "map.ply", cloud);
  for (const std::size_t most : {64, 500, 1000}) {
    const MapPoints points(folder / "map.ply", most);
    EXPECT_EQ(points.size(), 1000U);
    std::vector<Vec3> read;
    points.visit([&](std::size_t first, const PointCloud& block) {
      EXPECT_EQ(first, read.size());
      EXPECT_LE(block.size(), most);
      read.insert(read.end(), block.positions.begin(), block.positions.end());
    });
    EXPECT_EQ(read, cloud.positions) << most;
  }
}

TEST(TiledScores, EntropyIsThatOfTheWholeMap) {
  for (const PointCloud& cloud : {sheet(6000), lattice(14)}) {
    for (const std::size_t most : {90, 1000}) {
      const Tiled tiled(cloud, most);
      for (const metrics::MapEntropyOptions& options :
           {metrics::MapEntropyOptions{.radius_m = 1.0},
            {.radius_m = 0.65, .max_points = 500},
            {.radius_m = 2.0, .max_points = 5000, .max_total_neighbors = 60000}}) {
        const metrics::MapEntropy expected = metrics::map_entropy(tiled.whole, options);
        const metrics::MapEntropy actual = map_entropy(tiled.tiles, options);
        ASSERT_GT(expected.evaluated, 50U);
        EXPECT_EQ(actual.points, expected.points);
        EXPECT_EQ(actual.sampled, expected.sampled);
        EXPECT_EQ(actual.evaluated, expected.evaluated);
        EXPECT_EQ(actual.mean, expected.mean) << most << " " << options.radius_m;
        EXPECT_EQ(actual.standard_error, expected.standard_error);
      }
    }
  }
}

TEST(TiledScores, TheMostCommonPlaceIsFoundInAnyTile) {
  PointCloud cloud = sheet(3000);
  const Vec3 place = cloud.positions[1234];
  for (int k = 0; k < 40; ++k) cloud.positions.insert(cloud.positions.begin() + 70 * k, place);
  for (const std::size_t most : {100, 5000}) {
    const Tiled tiled(cloud, most);
    const CommonPlace found = most_common_place(tiled.tiles);
    EXPECT_EQ(found.position, kPlaced * place);
    EXPECT_EQ(static_cast<std::ptrdiff_t>(found.points), std::ranges::count(tiled.whole.positions, found.position));
  }
  EXPECT_EQ(most_common_place(Tiled(lattice(5), 30).tiles).points, 1u);
}

TEST(TiledScores, NeighborsAreThoseOfTheWholeMap) {
  for (const PointCloud& cloud : {sheet(4000), lattice(12)}) {
    for (const std::size_t most : {30, 1000, 4000}) {
      const Tiled tiled(cloud, most);
      PointCloud asked = geometry::transformed(kPlaced, sheet(700));
      for (Vec3& p : asked.positions) p += Vec3(0.3, 0.1, 0.2);
      const std::vector<Vec3> at = tiled.tiles.at(tiled.tiles.sample_evenly(900)).positions;
      const MapNeighbors found = find_neighbors(tiled.tiles, asked.positions, at, 16);
      EXPECT_EQ(found.distances_m, metrics::cloud_distances(asked, tiled.whole, "asked", "map")) << most;
      const geometry::NearestIndex index(tiled.whole.positions);
      for (std::size_t k = 0; k < at.size(); ++k) {
        const Vec3 expected = alignment::estimate_normal(tiled.whole.positions, index, at[k], 16);
        EXPECT_EQ(found.normals[k], expected.cast<float>()) << most << " " << k;
      }
    }
  }
}

TEST(TiledScores, WassersteinOfVisitedPointsIsThatOfTheCloud) {
  const PointCloud map = sheet(3000), truth = lattice(14);
  const metrics::PointVisits visits = [&](const auto& visit) { std::ranges::for_each(map.positions, visit); };
  const metrics::VoxelWasserstein expected = metrics::voxel_wasserstein(map, truth),
                                  actual = metrics::voxel_wasserstein(visits, truth);
  ASSERT_GT(expected.voxels, 3U);
  EXPECT_EQ(actual.awd, expected.awd);
  EXPECT_EQ(actual.map_points, 3000U);
}

}  // namespace
}  // namespace tileflight::scoring::map_tiles_test
