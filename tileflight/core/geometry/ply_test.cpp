#include "tileflight/core/geometry/ply.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::ply_cloud_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

PointCloud cloud_of_all_attributes(std::size_t points) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  PointCloud cloud;
  for (std::size_t i = 0; i < points; ++i) {
    cloud.positions.emplace_back(2885.0 + normal(random), normal(random), -131.4 + normal(random));
    cloud.normals.emplace_back(0.0F, static_cast<float>(i), 1.0F);
    cloud.colors.push_back({static_cast<std::uint8_t>(i), 2, 255});
    cloud.scalars["observations"].push_back(static_cast<float>(i));
  }
  return cloud;
}

PointCloud part_of(const PointCloud& cloud, std::size_t first, std::size_t count) {
  std::vector<bool> keep(cloud.size());
  for (std::size_t i = first; i < first + count; ++i) keep[i] = true;
  return filter_points(cloud, keep);
}

void expect_equal(const PointCloud& actual, const PointCloud& expected) {
  EXPECT_EQ(actual.positions, expected.positions);
  EXPECT_EQ(actual.normals, expected.normals);
  EXPECT_EQ(actual.colors, expected.colors);
  EXPECT_EQ(actual.scalars, expected.scalars);
}

TEST(PlyCloudBlocks, HaveThePointsOfTheWhole) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = cloud_of_all_attributes(1000);
  write_cloud(folder / "map.ply", cloud);
  const auto blocks = PlyCloudBlocks::open(folder / "map.ply");
  ASSERT_TRUE(blocks);
  ASSERT_EQ(blocks->size(), 1000U);
  for (const auto& [first, count] : {std::pair<std::size_t, std::size_t>{0, 1000}, {0, 7}, {993, 7}, {400, 1}, {5, 0}})
    expect_equal(blocks->read(first, count), part_of(cloud, first, count));
}

TEST(PlyCloudBlocks, FollowedByOtherElements) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = cloud_of_all_attributes(20);
  write_cloud(folder / "map.ply", cloud);
  std::string bytes = base::read_text(folder / "map.ply");
  bytes.insert(bytes.find("end_header"), "element face 2\nproperty list uchar int vertex_indices\n");
  base::write_file(folder / "map.ply", bytes + std::string(26, '\3'));
  expect_equal(PlyCloudBlocks::open(folder / "map.ply")->read(3, 17), part_of(cloud, 3, 17));
}

TEST(PlyCloudBlocks, AreWrittenAsTheWholeIs) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = cloud_of_all_attributes(70000);
  write_cloud(folder / "whole.ply", cloud);
  for (const std::size_t block : {70000, 66000, 1234}) {
    std::size_t first = 0;
    write_ply_in_blocks(folder / "blocks.ply", cloud.size(), [&] {
      const std::size_t count = std::min(block, cloud.size() - first);
      return part_of(cloud, std::exchange(first, first + count), count);
    });
    EXPECT_TRUE(base::read_text(folder / "blocks.ply") == base::read_text(folder / "whole.ply")) << block;
  }
}

TEST(PlyCloudBlocks, NoneOfWhatMustBeReadWhole) {
  const tests::TemporaryFolder folder;
  const PointCloud cloud = cloud_of_all_attributes(5);
  write_cloud(folder / "text.ply", cloud, CloudEncoding::kAscii);
  write_cloud(folder / "map.pcd", cloud);
  write_cloud(folder / "cut.ply", cloud);
  const std::string bytes = base::read_text(folder / "cut.ply");
  base::write_file(folder / "cut.ply", bytes.substr(0, bytes.size() - 1));
  base::write_file(folder / "header.ply", bytes.substr(0, bytes.find("end_header")));
  base::write_file(folder / "empty.ply", "");
  base::write_file(folder / "list.ply",
                   "ply\nformat binary_little_endian 1.0\nelement vertex 0\nproperty float x\nproperty float y\n"
                   "property float z\nproperty list uchar int seen\nend_header\n");
  base::write_file(folder / "later.ply",
                   "ply\nformat binary_little_endian 1.0\nelement camera 0\nproperty float f\nelement vertex 0\n"
                   "property float x\nproperty float y\nproperty float z\nend_header\n");
  for (const char* name :
       {"text.ply", "map.pcd", "cut.ply", "header.ply", "empty.ply", "list.ply", "later.ply", "none.ply"})
    EXPECT_FALSE(PlyCloudBlocks::open(folder / name)) << name;
}

TEST(PlyCloudBlocks, SayWhatIsWrong) {
  const tests::TemporaryFolder folder;
  PointCloud cloud = cloud_of_all_attributes(20);
  cloud.positions[13].y() = std::nan("");
  write_cloud(folder / "map.ply", cloud);
  const auto blocks = PlyCloudBlocks::open(folder / "map.ply");
  EXPECT_THAT([&] { blocks->read(10, 10); },
              ThrowsMessage<InputError>(HasSubstr("position of point 13 is not finite")));
  std::filesystem::resize_file(folder / "map.ply", 900);
  EXPECT_THAT([&] { blocks->read(10, 10); }, ThrowsMessage<InputError>(HasSubstr("has become shorter")));
}

}  // namespace
}  // namespace tileflight::geometry::ply_cloud_test
