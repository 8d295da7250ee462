#include "tileflight/core/alignment/regions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "tests/height_field.h"
#include "tileflight/core/alignment/align_globally.h"
#include "tileflight/core/alignment/icp.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::alignment::region_list_test {
namespace {

using geometry::Box3;
using geometry::Vec3;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

TEST(RegionList, ToJsonAndBack) {
  const RegionList list{{Box3(Vec3(0, 1, 2), Vec3(3, 4, 5.5))}, {Box3(Vec3(-9, 0, 0), Vec3(-8, 1, 1))}, true};
  const RegionList back = regions_from_json(json::parse(to_json(list).dump()), "transform.json");
  ASSERT_EQ(back.aligned_on.size(), 1u);
  ASSERT_EQ(back.held_out.size(), 1u);
  EXPECT_TRUE(back.aligned_on[0].isApprox(list.aligned_on[0]));
  EXPECT_TRUE(back.held_out[0].isApprox(list.held_out[0]));
  EXPECT_TRUE(back.found);
  EXPECT_TRUE(regions_from_json(json::object(), "transform.json").aligned_on.empty());
}

TEST(RegionList, RefusesWhatIsNone) {
  const auto expect_refused = [](const char* text, const char* message) {
    EXPECT_THAT([&] { regions_from_json(json::parse(text), "transform.json"); },
                ThrowsMessage<InputError>(HasSubstr(message)))
        << text;
  };
  expect_refused("[]", "transform.json: 'regions' must be an object");
  expect_refused("3", "transform.json: 'regions' must be an object");
  expect_refused(R"({"held_out": 1})", "'held_out' must be a list of regions");
  expect_refused(R"({"held_out": [1]})", "a region needs 'center', three numbers");
  expect_refused(R"({"held_out": [{"center": [1, 2]}]})", "a region needs 'center', three numbers");
  expect_refused(R"({"aligned_on": [{"center": [1, 2, 3], "size": [1, 1, 0]}]})",
                 "the size of a region must be positive");
  expect_refused(R"({"aligned_on": [{"center": [1, 2, "x"], "size": [1, 1, 1]}]})",
                 "a region needs 'center', three numbers");
}

}  // namespace
}  // namespace tileflight::alignment::region_list_test

namespace tileflight::alignment::find_regions_test {
namespace {

using geometry::PointCloud;
using geometry::TriangleMesh;
using geometry::Vec3;

/// A level field of 120 m with a block in the middle of six of its 64 cells of 15 m, and a bumpy thicket in two others.
const std::vector<std::pair<int, int>> kBlocks = {{1, 1}, {6, 1}, {3, 3}, {1, 6}, {5, 5}, {6, 6}};
const std::vector<std::pair<int, int>> kThickets = {{0, 3}, {7, 4}};

bool in_cell(double x, double y, std::pair<int, int> cell) {
  return static_cast<int>(std::floor(x / 15.0)) == cell.first && static_cast<int>(std::floor(y / 15.0)) == cell.second;
}

double height_m(double x, double y) {
  for (const auto& cell : kBlocks) {
    if (std::abs(x - 15.0 * cell.first - 7.5) < 4.0 && std::abs(y - 15.0 * cell.second - 7.5) < 4.0) return 8.0;
  }
  for (const auto& cell : kThickets) {
    if (in_cell(x, y, cell)) return 3.0 + 0.6 * std::sin(5.1 * x) * std::cos(4.7 * y) + 0.4 * std::sin(8.3 * y + x);
  }
  return 0.0;
}

TriangleMesh place() { return tests::height_field(240, 0.0, 120.0, height_m); }

PointCloud points_of(const TriangleMesh& mesh, std::size_t n) {
  PointCloud cloud;
  cloud.positions = sample_surface_evenly(mesh, n);
  return cloud;
}

bool is_block(const FoundRegion& region) {
  const Vec3 c = region.box.center();
  return std::any_of(kBlocks.begin(), kBlocks.end(), [&](const auto& cell) { return in_cell(c.x(), c.y(), cell); });
}

TEST(FindRegions, BlocksNotLawnsNorThickets) {
  const TriangleMesh mesh = place();
  const PointCloud map = points_of(mesh, 20000);
  FindRegionsOptions options;
  options.max_regions = 6;
  const FoundRegions found = find_regions(mesh, {&map}, options);
  EXPECT_EQ(found.aligned_on.size(), 3u);
  EXPECT_EQ(found.held_out.size(), 3u);
  for (const auto* list : {&found.aligned_on, &found.held_out}) {
    for (const FoundRegion& region : *list) {
      EXPECT_TRUE(is_block(region)) << region.box.center().transpose();
      EXPECT_GT(region.corner_strength, 0.05);
      EXPECT_GT(region.planarity, 0.8);
    }
  }
}

TEST(FindRegions, OnlyWhereEveryMapHasPoints) {
  const TriangleMesh mesh = place();
  const PointCloud all = points_of(mesh, 20000);
  PointCloud west;
  for (const Vec3& p : all.positions) {
    if (p.x() < 60.0) west.positions.push_back(p);
  }
  const FoundRegions found = find_regions(mesh, {&all, &west});
  ASSERT_FALSE(found.aligned_on.empty());
  for (const auto* list : {&found.aligned_on, &found.held_out}) {
    for (const FoundRegion& region : *list) EXPECT_LT(region.box.max().x(), 60.1);
  }
  PointCloud high = all;
  for (Vec3& p : high.positions) p.z() += 30.0;
  EXPECT_TRUE(find_regions(mesh, {&high}).aligned_on.empty()) << "what lies above was not seen of it";
}

TEST(FindRegions, NoneOnALawn) {
  const TriangleMesh lawn = tests::height_field(60, 0.0, 120.0, [](double, double) { return 0.0; });
  const PointCloud map = points_of(lawn, 20000);
  const FoundRegions found = find_regions(lawn, {&map});
  EXPECT_TRUE(found.aligned_on.empty());
  EXPECT_TRUE(found.held_out.empty());
  EXPECT_TRUE(find_regions({}, {&map}).aligned_on.empty());
}

TEST(FindRegions, AlignmentOnThemIsHeldFirmly) {
  const TriangleMesh mesh = place();
  const geometry::TriangleIndex index(mesh);
  const PointCloud map = points_of(mesh, 20000);
  IcpOptions options = converging_icp_options();
  for (const FoundRegion& region : find_regions(mesh, {&map}).aligned_on) options.regions.push_back(region.box);
  const geometry::Sim3 off(1.01, geometry::so3_exp({0.005, -0.004, 0.01}), {0.3, -0.2, 0.2});
  const IcpResult result = icp(map, index, mesh, off, options);
  EXPECT_TRUE(result.converged) << result.note;
  EXPECT_TRUE(result.constraint.well_constrained);
  EXPECT_LT((result.T_target_source * Vec3(60, 60, 0) - Vec3(60, 60, 0)).norm(), 0.01);
}

}  // namespace
}  // namespace tileflight::alignment::find_regions_test
