#include "tileflight/evaluation/metrics/region_scores.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics::region_scores_test {
namespace {

using geometry::Box3;
using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

const Box3 kLeft(Vec3(0, 0, 0), Vec3(10, 10, 10)), kRight(Vec3(8, 0, 0), Vec3(20, 10, 10)),
    kEmpty(Vec3(90, 0, 0), Vec3(95, 5, 5));
const std::vector<Vec3> kPoints = {{1, 1, 1}, {2, 2, 2}, {9, 1, 1}, {15, 1, 1}, {16, 1, 1}, {50, 1, 1}};
const std::vector<double> kDistances_m = {0.1, 0.3, 0.5, 1.0, 3.0, 100.0};

TEST(RegionScores, EachBoxAndAllOfAKind) {
  const RegionScores s = score_regions(kPoints, kDistances_m, {kLeft}, {kRight, kEmpty});
  ASSERT_EQ(s.each.size(), 3u);
  EXPECT_EQ(s.each[0].distances.count, 3u);
  EXPECT_NEAR(s.each[0].distances.mean, 0.3, 1e-12);
  EXPECT_EQ(s.each[1].distances.count, 3u) << "the point in both counts in each";
  EXPECT_NEAR(s.each[1].distances.mean, 1.5, 1e-12);
  EXPECT_EQ(s.each[2].distances.count, 0u);
  EXPECT_TRUE(std::isnan(s.each[2].distances.mean));
  EXPECT_EQ(s.aligned_on.count, 3u);
  EXPECT_EQ(s.held_out.count, 2u) << "what was aligned on is not held out";
  EXPECT_NEAR(s.held_out.mean, 2.0, 1e-12);
  EXPECT_NEAR(s.held_out.rmse, std::sqrt(5.0), 1e-12);
}

TEST(RegionScores, JsonAndBack) {
  const RegionScores s = score_regions(kPoints, kDistances_m, {kLeft}, {kRight, kEmpty});
  const nlohmann::json written = to_json(s);
  const RegionScores back =
      read_region_scores(base::StrictSection(nlohmann::json::parse(written.dump()), "metrics.json"));
  EXPECT_EQ(to_json(back).dump(), written.dump());
  ASSERT_EQ(back.each.size(), 3u);
  EXPECT_TRUE(back.each[1].held_out);
  EXPECT_TRUE(back.each[1].box.isApprox(kRight));
}

TEST(RegionScores, BrokenOnesAreRefused) {
  nlohmann::json broken = nlohmann::json::parse(to_json(score_regions(kPoints, kDistances_m, {kLeft}, {})).dump());
  broken["each"][0]["use"] = "both";
  EXPECT_THAT([&] { read_region_scores(base::StrictSection(broken, "metrics.json")); },
              ThrowsMessage<InputError>(HasSubstr("'each[0].use' must be")));
  broken["each"] = 3;
  EXPECT_THAT([&] { read_region_scores(base::StrictSection(broken, "metrics.json")); },
              ThrowsMessage<InputError>(HasSubstr("'each' must be a list")));
}

}  // namespace
}  // namespace tileflight::metrics::region_scores_test
