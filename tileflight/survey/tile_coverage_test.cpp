#include "tileflight/survey/tile_coverage.h"

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include "tileflight/transport/test_tilesets.h"

namespace tileflight::survey::tile_coverage_test {
namespace {

using ::testing::ElementsAre;
using transport::test_support::box_volume;
using transport::test_support::Json;
using transport::test_support::MemorySource;
using transport::test_support::tile;

/// root (8 m) > middle (2 m) > leaf (0 m), all over the same ground.
Json chain(const std::string& refine_of_middle) {
  Json middle = tile(box_volume(0, 0, 0, 10, 10, 1), 2, "middle.glb");
  middle["refine"] = refine_of_middle;
  middle["children"] = Json::array({tile(box_volume(0, 0, 0, 10, 10, 1), 0, "leaf.glb")});
  Json root = tile(box_volume(0, 0, 0, 10, 10, 1), 8, "root.glb");
  root["refine"] = "REPLACE";
  root["children"] = Json::array({middle});
  return transport::test_support::tileset(root);
}

std::vector<double> errors_of_stands(const std::string& refine_of_middle) {
  MemorySource source(chain(refine_of_middle));
  tiles::TilesetTree tree(source);
  const auto cut = tiles::select_cut(tree, tiles::region_criterion({{0, 0, 0}, {20, 20, 20}}, {}, 0.0));
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

}  // namespace
}  // namespace tileflight::survey::tile_coverage_test
