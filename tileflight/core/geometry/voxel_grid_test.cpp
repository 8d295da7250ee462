#include "tileflight/core/geometry/voxel_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>
#include <sstream>

#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::geometry::voxel_grid_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

VoxelGrid random_grid(const std::array<std::int32_t, 3>& dims, int cells) {
  std::mt19937 random(1);
  std::set<Cell> occupied;
  const auto below = [&](std::int32_t n) { return static_cast<std::int32_t>(random() % static_cast<unsigned>(n)); };
  for (int i = 0; i < cells; ++i) occupied.insert({below(dims[0]), below(dims[1]), below(dims[2])});
  return {Vec3(222.8, -256.4, 2869), 0.25, dims, {occupied.begin(), occupied.end()}};
}

/// Reader written only from the format's specification: "y runs fastest, then z, then x", all sides equal.
struct PlainBinvox {
  long side[3];
  double translate[3], scale;
  std::set<Cell> occupied;
};

PlainBinvox read_plainly(const std::filesystem::path& file) {
  std::istringstream in(base::read_text(file));
  PlainBinvox grid{};
  std::string word;
  in >> word >> word >> word >> grid.side[0] >> grid.side[1] >> grid.side[2];
  in >> word >> grid.translate[0] >> grid.translate[1] >> grid.translate[2] >> word >> grid.scale >> word;
  in.get();
  long index = 0;
  for (int value = in.get(), count = in.get(); in; value = in.get(), count = in.get()) {
    for (int i = 0; i < count; ++i, ++index) {
      const long plane = grid.side[1] * grid.side[2];
      if (value == 1) {
        grid.occupied.insert({static_cast<std::int32_t>(index / plane), static_cast<std::int32_t>(index % grid.side[2]),
                              static_cast<std::int32_t>(index % plane / grid.side[2])});
      }
    }
  }
  EXPECT_EQ(index, grid.side[0] * grid.side[1] * grid.side[2]);
  return grid;
}

TEST(Binvox, IsReadByAReaderWrittenFromTheSpecification) {
  const tests::TemporaryFolder folder;
  const VoxelGrid grid = random_grid({40, 30, 20}, 3000);
  write_binvox(folder / "v.binvox", grid);
  const PlainBinvox plain = read_plainly(folder / "v.binvox");
  EXPECT_EQ(std::vector(plain.occupied.begin(), plain.occupied.end()), grid.occupied);
  EXPECT_EQ(plain.translate[2], 2869);
  // Padded to a cube, as the specification asks; the scale is the cube's side in metres, not its inverse.
  for (const long side : plain.side) EXPECT_EQ(side, 40);
  EXPECT_DOUBLE_EQ(plain.scale, 40 * 0.25);
}

TEST(Binvox, RoundTrip) {
  const tests::TemporaryFolder folder;
  for (const auto& dims :
       {std::array{1, 1, 1}, std::array{40, 30, 20}, std::array{3, 1, 500}, std::array{2000, 900, 700}}) {
    const VoxelGrid grid = random_grid(dims, 5000);
    write_binvox(folder / "v.binvox", grid);
    const VoxelGrid read = read_binvox(folder / "v.binvox");
    EXPECT_EQ(read.occupied, grid.occupied);
    EXPECT_EQ(read.origin, grid.origin);
    EXPECT_EQ(read_binvox_header(folder / "v.binvox").dims, read.dims);
    EXPECT_TRUE(read_binvox_header(folder / "v.binvox").occupied.empty());
    EXPECT_DOUBLE_EQ(read.edge_m, grid.edge_m);
    for (std::size_t axis = 0; axis < 3; ++axis) EXPECT_GE(read.dims[axis], dims[axis]);
  }
}

TEST(Binvox, FullAndEmptyGrids) {
  const tests::TemporaryFolder folder;
  VoxelGrid grid{Vec3::Zero(), 1.0, {9, 9, 9}, {}};
  write_binvox(folder / "empty.binvox", grid);
  EXPECT_TRUE(read_binvox(folder / "empty.binvox").occupied.empty());
  for (int i = 0; i < 729; ++i) grid.occupied.push_back({i / 81, i / 9 % 9, i % 9});
  write_binvox(folder / "full.binvox", grid);
  EXPECT_EQ(read_binvox(folder / "full.binvox").occupied, grid.occupied);
}

const std::string kHead = "#binvox 1\ndim 2 2 2\ntranslate 0 0 0\nscale 2\ndata\n";

VoxelGrid read_bytes_as_grid(const std::string& bytes) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "v.binvox", bytes);
  return read_binvox(folder / "v.binvox");
}

TEST(Binvox, RunsOfLengthZeroAreAccepted) {
  const VoxelGrid grid = read_bytes_as_grid(kHead + std::string("\1\0\0\7\0\0\1\1", 8));
  ASSERT_EQ(grid.occupied.size(), 1U);
  EXPECT_EQ(grid.occupied[0], (Cell{1, 1, 1}));
}

TEST(Binvox, OrderOfTheData) {
  // Index 1 is one step along y, index 2 one step up, index 4 one step along x.
  EXPECT_EQ(read_bytes_as_grid(kHead + std::string("\0\1\1\1\0\6", 6)).occupied[0], (Cell{0, 1, 0}));
  EXPECT_EQ(read_bytes_as_grid(kHead + std::string("\0\2\1\1\0\5", 6)).occupied[0], (Cell{0, 0, 1}));
  EXPECT_EQ(read_bytes_as_grid(kHead + std::string("\0\4\1\1\0\3", 6)).occupied[0], (Cell{1, 0, 0}));
}

TEST(Binvox, BadInputIsNamed) {
  const auto expect = [](const std::string& bytes, const std::string& message) {
    EXPECT_THAT([&] { read_bytes_as_grid(bytes); }, ThrowsMessage<InputError>(HasSubstr(message))) << bytes;
  };
  expect("", "is not a binvox file");
  expect("#binvox 2\n", "is not a binvox file of version 1");
  expect("#binvox 1\ndim 2 2 2\n", "no line 'data'");
  expect("#binvox 1\ndata\n", "no line 'dim'");
  expect("#binvox 1\ndim 2 2\ndata\n", "line 2: expected 3 numbers after 'dim'");
  expect("#binvox 1\ndim 2 0 2\ndata\n", "line 2: a side has no cells");
  expect("#binvox 1\ndim 2 -2 2\ndata\n", "a side has no cells");
  expect("#binvox 1\ndim 2147483647 2147483647 2147483647\ndata\n", "too many cells");
  expect("#binvox 1\ndim 2 2 2\nscale 0\ndata\n", "scale above zero");
  expect("#binvox 1\ndim 2 2 2\ntranslate nan 0 0\ndata\n", "must be finite");
  expect("#binvox 1\nsize 2\ndata\n", "line 2: 'size' is not a key");
  expect(kHead + std::string("\0\7", 2), "the runs hold 7 of 8 cells: the file is truncated");
  expect(kHead + std::string("\0\7\1", 3), "the runs hold 7 of 8 cells");
  expect(kHead + std::string("\0\7\1\2", 4), "the runs hold more cells");
  expect(kHead + std::string("\0\7\5\1", 4), "must be 0 or 1");
}

TEST(Binvox, FullDiskIsAnError) {
  EXPECT_THAT(
      [] {
        write_binvox("/dev/full", random_grid({9, 9, 9}, 50));
      },
      ThrowsMessage<InputError>(HasSubstr("No space left on device")));
}

TEST(Centers, AreTheMiddlesOfTheCells) {
  const VoxelGrid grid = random_grid({40, 30, 20}, 100);
  const PointCloud cloud = cell_centers(grid);
  ASSERT_EQ(cloud.size(), grid.occupied.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_LT((cloud.positions[i] - grid.center(grid.occupied[i])).norm(), 1e-9);
  }
  EXPECT_EQ(cell_centers({Vec3(1, 2, 3), 2.0, {1, 1, 1}, {{0, 0, 0}}}).positions[0], Vec3(2, 3, 4));
}

}  // namespace
}  // namespace tileflight::geometry::voxel_grid_test
