#include "tileflight/world/place/ground_tiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <optional>
#include <random>
#include <vector>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tests/tiny_city.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/world/scene/scene.h"

namespace tileflight::place::ground_tiles_test {
namespace {

using geometry::Vec3;
using testing::HasSubstr;
using tests::TinyCity;

class GroundTilesTest : public testing::Test {
 protected:
  GroundTilesTest() {
    TinyCity::write(folder_ / "place");
    load_.allow_large_area = true;
    load_.error_m = 2.0;  // not the finest level
  }
  std::string source() const { return (folder_ / "place").string(); }
  tileset::LoadOptions with_memory(std::uintmax_t bytes) const {
    tileset::LoadOptions load = load_;
    load.max_memory_bytes = bytes;
    return load;
  }
  /// Positions all over the place, along one way, and outside.
  static std::vector<Vec3> positions() {
    std::vector<Vec3> all{{9999, 0, 1e5}, {1e300, 0, 1e5}, {0, -1e9, 0}};
    std::mt19937 random(4);
    std::uniform_real_distribution<double> in(-650, 650);
    for (int i = 0; i < 150; ++i) all.emplace_back(in(random), in(random), i % 3 == 0 ? 100.0 : 1e5);
    for (double x = -600; x < 600; x += 5.0) all.emplace_back(x, 0.3 * x, 1e5);
    return all;
  }
  std::vector<std::optional<double>> heights(GroundTiles& ground) const {
    std::vector<std::optional<double>> found;
    for (const Vec3& p : positions()) found.push_back(ground.height(p.x(), p.y(), p.z()));
    return found;
  }

  tests::TemporaryFolder folder_;
  tileset::LoadOptions load_;
};

TEST_F(GroundTilesTest, FindsTheUppermostSurfaceOfAllTiles) {
  const geometry::TriangleMesh mesh = scene::merge_meshes(tileset::load_region(source(), load_).meshes);
  GroundTiles ground(source(), load_);
  int on_ground = 0, none = 0;
  for (const Vec3& p : positions()) {
    std::optional<double> expected;
    if (std::abs(p.x()) < 1e6 && std::abs(p.y()) < 1e6) {
      for (const double z : geometry::surface_heights_at(mesh, p.x(), p.y())) {
        if (z <= p.z() && (!expected || z > *expected)) expected = z;
      }
    }
    const std::optional<double> found = ground.height(p.x(), p.y(), p.z());
    ASSERT_EQ(found.has_value(), expected.has_value()) << p.transpose();
    (found ? on_ground : none) += 1;
    if (!found) continue;
    EXPECT_NEAR(*found, *expected, 1e-4) << p.transpose();
  }
  EXPECT_GT(on_ground, 200);
  EXPECT_GT(none, 30);
}

TEST_F(GroundTilesTest, MemoryChangesNothingButHowOftenTilesAreRead) {
  GroundTiles plenty(source(), load_), little(source(), with_memory(400'000));
  EXPECT_EQ(heights(plenty), heights(little));
  EXPECT_GT(little.read_count(), plenty.read_count());
  const std::int64_t read = plenty.read_count();
  heights(plenty);
  EXPECT_EQ(plenty.read_count(), read) << "what is in memory is not read again";
}

TEST_F(GroundTilesTest, ReadsOnlyWhatIsBelow) {
  GroundTiles ground(source(), load_);
  EXPECT_EQ(ground.read_count(), 0);
  EXPECT_TRUE(ground.height(-500, -500, 1e5));
  EXPECT_GT(ground.read_count(), 0);
  EXPECT_LE(ground.read_count(), 4);
}

TEST_F(GroundTilesTest, RefusesACellThatDoesNotFitAndABrokenTile) {
  GroundTiles tight(source(), with_memory(2000));
  EXPECT_THAT(tests::refusal_of([&] { tight.height(0, 0, 1e5); }), HasSubstr("raise the limit (--memory)"));
  for (const auto& file : std::filesystem::directory_iterator(folder_ / "place")) {
    if (file.path().extension() == ".glb") std::filesystem::resize_file(file.path(), 100);
  }
  GroundTiles broken(source(), load_);
  EXPECT_THAT(tests::refusal_of([&] { broken.height(0, 0, 1e5); }), HasSubstr(".glb"));
}

}  // namespace
}  // namespace tileflight::place::ground_tiles_test
