#include "tileflight/world/place/extract_cost.h"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/test_byte_strings.h"

namespace tileflight::place::extract_cost_test {
namespace {

using ::testing::HasSubstr;
using tileset::ContentMeasures;

constexpr std::uintmax_t kPlenty = std::uintmax_t{1} << 60;

ContentMeasures tile(double triangles) {
  return {.file_bytes = 1e5,
          .triangles = triangles,
          .vertices = triangles / 2,
          .points = 0,
          .texels = 1e5,
          .attribute_bytes = 4 * triangles,
          .area_m2 = 500};
}

TEST(ExtractCost, OfAllTilesHasNoSpreadAndOfSomeIsProportional) {
  const ExtractCost all = estimate_extract_cost({tile(1000), tile(3000)}, 2, 2e5, 16);
  EXPECT_EQ(all.spread, 0.0);
  EXPECT_EQ(all.triangles, 4000);
  EXPECT_EQ(all.bytes_read, 2e5);
  const ExtractCost some = estimate_extract_cost({tile(1000), tile(3000)}, 2000, -1, 16);
  EXPECT_GT(some.spread, 0.1);
  EXPECT_DOUBLE_EQ(some.triangles, 4e6);
  EXPECT_DOUBLE_EQ(some.bytes_read, 2e8);
  EXPECT_DOUBLE_EQ(some.disk_bytes, 1000 * all.disk_bytes);
  EXPECT_NEAR(some.scaled(0.001).memory_bytes, all.memory_bytes, 1.0);
  EXPECT_TRUE(std::isinf(estimate_extract_cost({tile(1000)}, 2000, -1, 16).spread));
  EXPECT_EQ(estimate_extract_cost({}, 0, 0, 16).triangles, 0);
}

TEST(ExtractCost, WhatIsCertainlyTooMuchIsRefusedWithWhatToChange) {
  const auto error_of = [](const ExtractCost& cost, std::uintmax_t memory) {
    return base::test_support::error_of([&] { require_affordable(cost, memory, "out/truth"); });
  };
  const std::vector<ContentMeasures> probes(10, tile(10000));
  const ExtractCost cost = estimate_extract_cost(probes, 1000, -1, 16);
  EXPECT_EQ(error_of(cost, kPlenty), "");
  const auto memory = static_cast<std::uintmax_t>(cost.memory_bytes);
  EXPECT_EQ(error_of(cost, memory), "");
  EXPECT_EQ(error_of(cost, memory * 9 / 10), "") << "it may just fit";
  EXPECT_THAT(error_of(cost, memory / 2), HasSubstr("of memory, and"));
  EXPECT_THAT(error_of(cost, memory / 2), HasSubstr("extract in blocks (--block auto), a smaller region"));
  EXPECT_THAT(error_of(estimate_extract_cost(probes, 2e4, -1, 0), kPlenty), HasSubstr("the 4 GiB that a GLB file"));
  EXPECT_THAT(error_of(estimate_extract_cost(probes, 1e4, -1, 1e9), kPlenty), HasSubstr("are free: choose another"));
}

/// Tiles so different that a few of them tell nothing are not refused.
TEST(ExtractCost, WhatIsUncertainIsNotRefused) {
  std::vector<ContentMeasures> probes(5, tile(10));
  probes.push_back(tile(1e6));
  const ExtractCost cost = estimate_extract_cost(probes, 600, -1, 0);
  EXPECT_GT(cost.spread, 1.0);
  EXPECT_NO_THROW(require_affordable(cost, 1000000, "out"));
}

TEST(ExtractCost, IsSaid) {
  const ExtractCost cost = estimate_extract_cost(std::vector<ContentMeasures>(10, tile(10000)), 462, 58e6, 16);
  EXPECT_THAT(cost_text(cost), HasSubstr("462 tiles (58 MB), 4.62 million triangles: "));
  EXPECT_THAT(cost_text(cost), HasSubstr("(± 0 %)"));
  EXPECT_EQ(to_json(cost)["tiles"], 462);
  EXPECT_EQ(to_json(cost)["triangles"], 4620000);
}

}  // namespace
}  // namespace tileflight::place::extract_cost_test
