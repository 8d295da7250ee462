#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tileflight/experiments/report/tables.h"

namespace tileflight::report::place_tables_test {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::SizeIs;

TEST(PlaceTable, SaysWhatWasLoaded) {
  const json truth{{"tiles_wanted", 40}, {"tiles_loaded", 39},          {"tiles_failed", 1},   {"complete", false},
                   {"voxel_size", 0.5},  {"voxels_occupied", 118308.0}, {"triangles", nullptr}};
  const Table table = place_table({{"truth", truth}});
  ASSERT_THAT(table.rows, SizeIs(8));
  EXPECT_THAT(table.rows[1], ElementsAre("Tiles loaded", "39"));
  EXPECT_THAT(table.rows[3], ElementsAre("Complete at the requested error", "no"));
  EXPECT_THAT(table.rows[5], ElementsAre("Triangles", "\u2013"));
  EXPECT_THAT(table.rows[7], ElementsAre("Occupied voxels", "118,308"));
  EXPECT_THAT(place_table({{"truth", "elsewhere"}}).rows, SizeIs(0));
}

TEST(CoverageTable, HasARowAWayOfLoading) {
  const json coverage{{"strategies",
                       {{"flight", {{"tiles", 64}, {"right", 1.0}, {"coarser", 0}, {"missing", 0}, {"cells_share", 1}}},
                        {"view-<b>", {{"tiles", 28}, {"right", 0.8098}, {"missing_worst", 0.1379}}}}}};
  const Table table = coverage_table(coverage);
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_THAT(table.rows[1],
              ElementsAre("view-<b>", "28", "80.98\u00A0%", "\u2013", "\u2013", "13.79\u00A0%", "\u2013"));
  EXPECT_THAT(to_html(table).str(), testing::HasSubstr("view-&lt;b&gt;"));
  EXPECT_THAT(coverage_table(nullptr).rows, SizeIs(0));
  EXPECT_THAT(coverage_table({{"strategies", {1, 2}}}).rows, SizeIs(0));
}

/// A map of four points in a region of 300 m about the origin.
RunFolder four_points() {
  RunFolder run;
  run.results = {{"truth", {{"region", {{"center", {0, 0, 0}}, {"size", {300, 300, 50}}}}}}};
  FlightRun flight;
  flight.label = "Simulated";
  flight.errors.emplace();
  flight.errors->positions = {{-100, 100, 0}, {-120, 130, 0}, {0, 0, 5}, {200, 0, 0}};
  flight.errors->scalars["surface_distance"] = {0.1F, 0.7F, INFINITY, 0.1F};
  run.flights.push_back(flight);
  return run;
}

TEST(PartsTable, CountsWhatLiesInEachThird) {
  const Table table = parts_table(four_points());
  ASSERT_THAT(table.rows, SizeIs(9));
  EXPECT_THAT(table.rows[0], ElementsAre("North-west", "2", "0.700", "50.0\u00A0%"));
  EXPECT_THAT(table.rows[4], ElementsAre("Middle", "1", "\u2013", "0.0\u00A0%")) << "no distance is no success";
  EXPECT_THAT(table.rows[5], ElementsAre("East", "0", "\u2013", "\u2013"))
      << "what lies beside the region is not counted";
  EXPECT_THAT(table.groups, ElementsAre("Simulated"));
}

TEST(PartsTable, IsEmptyWithoutMaps) {
  RunFolder run = four_points();
  run.flights[0].errors.reset();
  EXPECT_TRUE(parts_table(run).rows.empty());
}

}  // namespace
}  // namespace tileflight::report::place_tables_test
