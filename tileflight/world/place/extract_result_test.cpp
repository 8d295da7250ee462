#include "tileflight/world/place/extract_result.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"

namespace tileflight::place::extract_result_test {
namespace {

using testing::HasSubstr;

ExtractResult some_result() {
  ExtractResult result;
  result.source = "tiles/tileset.json";
  result.tiles_wanted = 462;
  result.tiles_loaded = 461;
  result.tiles_failed = 1;
  result.failures = {"a.b3dm: is truncated"};
  result.complete = false;
  result.geometric_error_max_m = 0.1234567890123;
  result.voxel_m = 0.5;
  result.voxel_dims = {500, 500, 120};
  const geometry::Ring triangle{{0.0, 0.0}, {1.5, 0.0}, {1.5, 1.25}};
  result.region =
      tileset::Region{geometry::Vec3(0.1, -0.2, 30.0),
                      geometry::Vec3(250.0, 250.0, 60.0),
                      {geometry::Prism{geometry::PolygonArea(std::vector<geometry::Ring>{triangle}), -3.0, 10.5}}};
  result.origin = geometry::Geodetic{35.310344, -80.740007, geometry::EllipsoidalHeight{215.0}};
  result.attribution = {"A", "B"};
  result.seconds = {.load_s = 1.25, .truth_s = 2.5, .total_s = 3.75};
  result.quantization_floor = ground_truth::FloorStatistics{
      .count = 9, .mean_m = 0.25, .std_m = 0.1, .median_m = 0.24, .rmse_m = 0.27, .max_m = 0.86};
  return result;
}

TEST(ExtractResult, WhatIsReadIsWrittenAgainToTheByte) {
  const tests::TemporaryFolder folder;
  write_extract_json(some_result(), folder.path());
  const std::string written = base::read_text(folder / "extract.json");
  write_extract_json(read_extract_json(folder.path()), folder.path());
  EXPECT_EQ(base::read_text(folder / "extract.json"), written);
  EXPECT_THAT(written, HasSubstr("\"geometric_error_max\": 0.1234567890123,"));
  EXPECT_THAT(written, HasSubstr("\"bottom\": -3.0"));
}

TEST(ExtractResult, MissingKeysKeepTheirDefaults) {
  const tests::TemporaryFolder folder;
  base::write_file(folder / "extract.json", "{\"source\": \"here\"}");
  const ExtractResult result = read_extract_json(folder.path());
  EXPECT_EQ(result.source, "here");
  EXPECT_TRUE(result.complete);
  EXPECT_FALSE(result.origin || result.quantization_floor || result.geometric_error_max_m);
  EXPECT_THAT(tests::refusal_of([&] { result.scored_region(); }), HasSubstr("does not state the region"));
}

TEST(ExtractResult, AWrongFileIsRefused) {
  const tests::TemporaryFolder folder;
  for (const char* text : {"[]", "{\"tiles_wanted\": \"many\"}", "{\"region\": {\"center\": [1, 2]}}"}) {
    base::write_file(folder / "extract.json", text);
    EXPECT_THAT(tests::refusal_of([&] { read_extract_json(folder.path()); }), HasSubstr("extract.json")) << text;
  }
}

TEST(ExtractResult, TheScoredRegionIsTheBoxWithItsPolygons) {
  const TruthRegion region = some_result().scored_region();
  EXPECT_NEAR(region.box.min().x(), -124.9, 1e-9);
  EXPECT_TRUE(region.contains_horizontally({1.0, 0.5, 99.0}));
  EXPECT_FALSE(region.contains_horizontally({1.0, 1.2, 0.0}));
}

}  // namespace
}  // namespace tileflight::place::extract_result_test
