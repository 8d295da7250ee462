#include "tileflight/capture/preview/pixel_counts.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/tiles/fetch/test_tilesets.h"

namespace tileflight::preview::pixel_counts_test {
namespace {

using fetch::test_support::box_volume;
using fetch::test_support::Json;
using fetch::test_support::MemorySource;
using fetch::test_support::tile;
using ::testing::ElementsAre;

/// root (8 m) > middle (2 m) > leaf (0 m), all over the same ground.
Json chain(const std::string& refine_of_middle) {
  Json middle = tile(box_volume(0, 0, 0, 10, 10, 1), 2, "middle.glb");
  middle["refine"] = refine_of_middle;
  middle["children"] = Json::array({tile(box_volume(0, 0, 0, 10, 10, 1), 0, "leaf.glb")});
  Json root = tile(box_volume(0, 0, 0, 10, 10, 1), 8, "root.glb");
  root["refine"] = "REPLACE";
  root["children"] = Json::array({middle});
  return fetch::test_support::tileset(root);
}

std::vector<double> errors_of_stands(const std::string& refine_of_middle) {
  MemorySource source(chain(refine_of_middle));
  tileset::TilesetTree tree(source);
  const auto cut = tileset::select_cut(tree, tileset::region_criterion({{0, 0, 0}, {20, 20, 20}}, {}, 0.0));
  std::vector<double> errors;
  for (const Substitute& stand : find_substitutes(tree, cut.contents.back())) errors.push_back(stand.geometric_error_m);
  return errors;
}

TEST(StandsFor, TilesAboveStandForWhatReplacesThem) {
  EXPECT_THAT(errors_of_stands("REPLACE"), ElementsAre(0, 2, 8));
  EXPECT_THAT(errors_of_stands("ADD"), ElementsAre(0)) << "an ADD tile shows other things than its children";
}

TEST(CountPixels, ByTheNearestStandInMemory) {
  const std::vector<std::vector<Substitute>> stands{{{2, 0.0}, {1, 2.0}, {0, 8.0}}};
  // 2 m at 100 m on 50 pixels a radian are 1 pixel; at 99 m a little more.
  const std::vector<PixelHit> frame{{0, 100.0}, {0, 99.0}, {PixelHit::kNoContent, 0.0}};
  const auto counted = [&](const std::vector<bool>& in_memory) {
    const PixelCounts s = count_pixels(frame, stands, in_memory, 50.0, 1.0);
    EXPECT_EQ(s.pixels, 2);
    return std::vector<std::int64_t>{s.right, s.coarser, s.missing};
  };
  EXPECT_THAT(counted({false, false, true}), ElementsAre(2, 0, 0));
  EXPECT_THAT(counted({true, true, true}), ElementsAre(2, 0, 0));
  EXPECT_THAT(counted({true, true, false}), ElementsAre(1, 1, 0));
  EXPECT_THAT(counted({true, false, false}), ElementsAre(0, 2, 0));
  EXPECT_THAT(counted({false, false, false}), ElementsAre(0, 0, 2));
}

/// Many triangles in 12 contents, some of them twice in two of them.
std::vector<imaging::TexturedMesh> random_contents() {
  std::mt19937 random(3);
  const auto within = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<imaging::TexturedMesh> meshes(12);
  for (imaging::TexturedMesh& mesh : meshes) {
    for (std::uint32_t i = 0; i < 60; ++i) {
      const geometry::Vec3 center(within(-40, 40), within(-40, 40), within(-5, 5));
      for (int corner = 0; corner < 3; ++corner)
        mesh.mesh.vertices.push_back(center + geometry::Vec3(within(-6, 6), within(-6, 6), within(-2, 2)));
      mesh.mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
  }
  meshes[7].mesh.vertices = meshes[2].mesh.vertices;
  return meshes;
}

TEST(TracePixels, ThroughPartsOfASceneAsThroughTheWhole) {
  const std::vector<imaging::TexturedMesh> meshes = random_contents();
  const auto rays = pixel_rays(imaging::make_fisheye(96, 64, 150.0));
  geometry::Mat3 down;
  down << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  const geometry::SE3 pose(down, geometry::Vec3(3, -2, 20));
  const geometry::Vec3 anchor(1, 2, 3);
  const auto trace = [&](std::size_t per_part, bool backwards) {
    std::vector<std::vector<std::uint32_t>> parts;
    for (std::uint32_t id = 0; id < meshes.size(); ++id) {
      if (id % per_part == 0) parts.emplace_back();
      parts.back().push_back(id);
    }
    if (backwards) std::ranges::reverse(parts);
    std::vector<PixelHit> nearest;
    for (const std::vector<std::uint32_t>& ids : parts) {
      std::vector<imaging::TexturedMesh> part;
      for (const std::uint32_t id : ids) part.push_back(meshes[id]);
      trace_pixels(scene::Scene(std::move(part), anchor), ids, rays, pose, nearest);
    }
    return nearest;
  };
  const std::vector<PixelHit> whole = trace(meshes.size(), false);
  EXPECT_GT(std::ranges::count_if(whole, [](const PixelHit& hit) { return hit.content != PixelHit::kNoContent; }),
            1000);
  for (const bool backwards : {false, true}) {
    for (const std::size_t per_part : {std::size_t{1}, std::size_t{5}}) {
      const std::vector<PixelHit> parts = trace(per_part, backwards);
      ASSERT_EQ(parts.size(), whole.size());
      for (std::size_t i = 0; i < whole.size(); ++i) {
        EXPECT_EQ(parts[i].distance_m, whole[i].distance_m);
        const auto same = [](std::uint32_t content) { return content == 7 ? 2U : content; };
        EXPECT_EQ(same(parts[i].content), same(whole[i].content));
        EXPECT_NE(parts[i].content, 7U) << "of two surfaces in one place the first content's is seen";
      }
    }
  }
}

}  // namespace
}  // namespace tileflight::preview::pixel_counts_test
