#include "tileflight/experiments/report/score_tables.h"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

namespace tileflight::report::score_tables_test {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::SizeIs;

std::vector<FlightRun> flights_with(const json& first, const json& second) {
  FlightRun a, b;
  a.label = "Simulated";
  a.values = first;
  b.label = "Real";
  b.values = second;
  return {a, b};
}

TEST(ScoreTables, AreEmptyForRunsWithoutThem) {
  const std::vector<FlightRun> none =
      flights_with(json::object(), {{"regions", 3}, {"runs", nullptr}, {"entropy", "x"}});
  EXPECT_TRUE(regions_table(none).rows.empty());
  EXPECT_TRUE(quality_table(none).rows.empty());
  EXPECT_TRUE(budget_table(none).rows.empty());
  EXPECT_TRUE(moving_table(none).rows.empty());
  EXPECT_TRUE(runs_table(none).rows.empty());
  EXPECT_TRUE(failure_table({{"failure", nullptr}}).rows.empty());
}

TEST(ScoreTables, RegionsSayWhatTheyWereFor) {
  const auto part = [](int points, double mean_m) {
    return json{{"points", points}, {"mean", mean_m}, {"median", 0.1}};
  };
  json held = part(50, 0.5);
  held.update({{"use", "held-out"}, {"center", {12.2, -30.4, 4}}, {"size", {5, 5, 5}}});
  const json regions{{"aligned_on", part(1200, 0.25)}, {"held_out", part(50, 0.5)}, {"each", {held}}};
  const Table table = regions_table(flights_with({{"regions", regions}}, json::object()));
  ASSERT_THAT(table.rows, SizeIs(3));
  EXPECT_THAT(table.rows[0], ElementsAre("All aligned on", "1,200", "0.2500", "0.1000", "\u2013", "\u2013", "\u2013"));
  EXPECT_EQ(table.rows[2][0], "Held out, at 12, -30, 4 m");
  EXPECT_THAT(table.header, SizeIs(7));
  EXPECT_THAT(table.groups, ElementsAre("Simulated", "Real"));
}

TEST(ScoreTables, OnlyKnownQualitiesHaveRows) {
  const Table table = quality_table(flights_with(
      {{"entropy", {{"mean", -2.5}, {"radius", 1.0}}}, {"surface", {{"normals", {{"mean_abs_cos", 0.9}}}}}},
      {{"trajectory", {{"drift", {{"translation_percent", 0.25}}}}}}));
  ASSERT_THAT(table.rows, SizeIs(4));
  EXPECT_THAT(table.rows[1], ElementsAre("Mean map entropy (lower is sharper)", "-2.500", "\u2013"));
  EXPECT_THAT(table.rows[3], ElementsAre("Drift, share of the distance", "\u2013", "0.250\u00A0%"));
}

TEST(ScoreTables, BudgetsSayHowAPartIsKnown) {
  const json budget{
      {"alignment", {{"metres", 0.0123}, {"kind", "estimated"}}}, {"total", 0.2}, {"path", {{"metres", nullptr}}}};
  const Table table = budget_table(flights_with({{"error_budget", budget}}, json::object()));
  ASSERT_THAT(table.rows, SizeIs(2));
  EXPECT_THAT(table.rows[0], ElementsAre("Alignment", "0.0123, estimated", "\u2013"));
}

TEST(ScoreTables, PointsOnMovingObjectsAreTold) {
  const json moving{{"points", 1200},
                    {"share", 0.125},
                    {"surface", {{"mean", 0.81}}},
                    {"with_them", {{"surface", {{"rmse", 0.4}}}, {"voxel", {{"mean", nullptr}}}}}};
  const Table table = moving_table(flights_with({{"moving_objects", moving}}, json::object()));
  ASSERT_THAT(table.rows, SizeIs(4));
  EXPECT_THAT(table.rows[0], ElementsAre("Points", "1,200", "\u2013"));
  EXPECT_THAT(table.rows[1], ElementsAre("Share of the map", "12.5\u00A0%", "\u2013"));
  EXPECT_EQ(table.rows[2][1], "0.8100");
  EXPECT_EQ(table.rows[3][1], "0.4000");
}

TEST(ScoreTables, RunsAreListedWithTheirSpread) {
  const json spread{{"map", {{"mean", {{"mean", 0.45}, {"std", 0.002}, {"ci95", {0.44, 0.46}}}}}},
                    {"surface", {{"median", {{"mean", 0.04}, {"std", 0.001}, {"ci95", nullptr}}}}}};
  const json list{{{"name", "1"}, {"points", 1000}, {"mean", 0.451}, {"backwards", false}},
                  {{"name", "2-backwards"}, {"backwards", true}, {"failed", "lost at frame 3"}}};
  const Table table = runs_table(flights_with({{"runs", {{"list", list}, {"spread", spread}}}}, json::object()));
  ASSERT_THAT(table.rows, SizeIs(3));
  EXPECT_THAT(table.rows[0], ElementsAre("Simulated, 1", "1,000", "0.4510", "\u2013", "\u2013"));
  EXPECT_THAT(table.rows[1], ElementsAre("Simulated, 2 backwards", "failed", "lost at frame 3", "\u2013", "\u2013"));
  EXPECT_EQ(table.rows[2][2], "0.4500 \u00b1 0.0020 (0.4400 to 0.4600)");
  EXPECT_EQ(table.rows[2][3], "0.0400 \u00b1 0.0010");
}

TEST(ScoreTables, FailuresAreTablesOfFour) {
  const json missed{{"questions", 100}, {"both", 20},  {"only_simulated", 5},  {"only_real", 10},
                    {"neither", 65},    {"phi", 0.62}, {"predicted", 2.0 / 3}, {"false_alarms", 0.2}};
  const Table table = failure_table({{"failure", {{"frames", nullptr}, {"places", {{"missed", missed}}}}}});
  ASSERT_THAT(table.rows, SizeIs(1));
  EXPECT_THAT(table.rows[0],
              ElementsAre("Places missed", "100", "20", "5", "10", "65", "0.620", "66.7\u00A0%", "20.0\u00A0%"));
}

}  // namespace
}  // namespace tileflight::report::score_tables_test
