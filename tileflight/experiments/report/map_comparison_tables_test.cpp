#include "tileflight/experiments/report/map_comparison_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/tables.h"

namespace tileflight::report::map_comparison_tables_test {
namespace {

using nlohmann::json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

json ratio(double simulated, double real, double low, double high, double margin, const char* verdict) {
  return {{"simulated", simulated},    {"real", real},         {"difference", simulated - real},
          {"ci95", {-1.0, 1.0}},       {"margin", margin},     {"ratio", simulated / real},
          {"ratio_ci95", {low, high}}, {"margin_of", "ratio"}, {"or_within", nullptr},
          {"decides", true},           {"unit", "blocks"},     {"verdict", verdict}};
}

json share(double simulated, double real, double low, double high, double margin, const char* verdict) {
  json value = ratio(simulated, real, 0.1, 9.0, margin, verdict);
  value["margin_of"] = "difference";
  value["ci95"] = {low, high};
  return value;
}

json results_with(const char* verdict, std::vector<std::string> because) {
  json within = ratio(0.01, 0.03, 0.2, 0.5, 1.1, "undecided");
  within["decides"] = false;
  json path = ratio(0.02, 0.03, 0.1, 4.2, 1.25, "equivalent");
  path["or_within"] = 0.1;
  const json comparison{
      {"mean_difference", -0.0256},
      {"mean_difference_ci95", {-0.0334, -0.018}},
      {"surface",
       {{"median", ratio(0.0422, 0.0604, 0.47, 1.05, 1.25, "undecided")},
        {"rms", ratio(0.1, 0.11, 0.85, 1.1, 1.25, "equivalent")},
        {"within_0.1", share(0.773, 0.69, 0.01, 0.15, 0.05, "undecided")},
        {"blocks", {{"edge", 42.0}, {"count", 36}}}}},
      {"completeness", {{"within_0.1", within}, {"lacking", share(0.252, 0.658, -0.56, -0.25, 0.01, "different")}}},
      {"path", {{"ate", path}}},
      {"missing_parts",
       {{"parts",
         {{{"center", {10.4, -3.0, 7.0}},
           {"edge", 4.0},
           {"points", {{"simulated", 0}, {"real", 1234}}},
           {"lacks", "simulated"}}}}}},
      {"verdict", verdict},
      {"verdict_on", {"surface.median", "surface.rms", "surface.within_0.1", "completeness.lacking", "path.ate"}},
      {"verdict_because", because}};
  return {{"simulated", {{"map", {{"mean", 0.4499}}}}},
          {"real", {{"map", {{"mean", 0.4755}}}, {"kind", "surrogate"}}},
          {"comparison", comparison}};
}

TEST(MapComparisonTables, TheVerdictSaysWhatDiffersAndThePublishedMeasureBeside) {
  const std::string sentence = verdict(results_with("different", {"completeness.lacking"}));
  EXPECT_THAT(sentence,
              HasSubstr("Simulation did not predict the surrogate flight's map: the missing share of what the other "
                        "map covers is 40.6 percentage points below the surrogate's (95\u00A0% interval "
                        "\u221256.0 to \u221225.0; equivalence margin 1 points)"));
  EXPECT_THAT(sentence, HasSubstr("By the published measure, distance to voxel centres: mean 0.4499 m simulated, "
                                  "0.4755 m surrogate, a difference of \u22120.0256 m"));
  EXPECT_THAT(sentence, Not(HasSubstr("median distance")));
}

TEST(MapComparisonTables, UndecidedNamesWhatStaysOpen) {
  const std::string sentence =
      verdict(results_with("undecided", {"surface.median", "surface.within_0.1", "path.ate", "completeness.lacking"}));
  EXPECT_THAT(
      sentence,
      HasSubstr(
          "Inconclusive: the data do not decide whether simulation predicts the surrogate flight's map: the median "
          "distance to the surface is 0.699 times the surrogate's (95\u00A0% interval 0.47 to 1.05; "
          "equivalence margin 1.25); the share of points within 0.1\u00A0m is 8.3 percentage "
          "points above"));
  EXPECT_THAT(sentence, HasSubstr("; and 1 more. By the published measure"));
}

TEST(MapComparisonTables, EquivalentNamesAllThatItRestsOn) {
  const std::string sentence = verdict(results_with("equivalent", {}));
  EXPECT_THAT(sentence, HasSubstr("Simulation predicted the surrogate flight's map: the median distance"));
  EXPECT_THAT(sentence, HasSubstr("; and 2 more."));
}

TEST(MapComparisonTables, ARowANumber) {
  const Table table = map_comparison_table(results_with("different", {"completeness.lacking"}));
  ASSERT_EQ(table.rows.size(), 6u);
  EXPECT_THAT(table.header, ElementsAre("", "Simulated", "Surrogate", "Simulated against second", "95 % interval",
                                        "Margin", "Verdict"));
  EXPECT_THAT(table.rows[0], ElementsAre("Median to the exact surface, m", "0.0422", "0.0604", "\u00D70.699",
                                         "0.47 to 1.05", "\u00D71.25", "undecided"));
  EXPECT_THAT(table.rows[2], ElementsAre("Points within 0.1\u00A0m", "77.3\u00A0%", "69.0\u00A0%", "+8.3 points",
                                         "+1.0 to +15.0", "5 points", "undecided"));
  EXPECT_EQ(table.rows[3].back(), "undecided (not used for the verdict)");
  EXPECT_EQ(table.rows[5][5], "\u00D71.25 or 0.1\u00A0m");
  EXPECT_EQ(table.rows[5][1], "0.020");
}

TEST(MapComparisonTables, TheTerminalHasTheSame) {
  const std::string text = map_comparison_text(results_with("different", {"completeness.lacking"}));
  EXPECT_THAT(text, HasSubstr("Simulation did not predict"));
  EXPECT_THAT(text, HasSubstr("Median to the exact surface, m"));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 8);
}

TEST(MapComparisonTables, PlacesThatOneMapLacks) {
  const Table table = missing_parts_table(results_with("different", {}));
  ASSERT_EQ(table.rows.size(), 1u);
  EXPECT_THAT(table.rows[0], ElementsAre("10, -3, 7", "4", "0", "1,234", "simulated"));
}

TEST(MapComparisonTables, WithoutThemThereIsNothing) {
  for (const json& results : {json(nullptr), json::object(), json{{"comparison", nullptr}},
                              json{{"comparison", {{"surface", nullptr}, {"verdict", "equivalent"}}}},
                              json{{"comparison", {{"surface", 7}, {"completeness", {{"within_0.2", "a"}}}}}}}) {
    EXPECT_TRUE(map_comparison_table(results).rows.empty()) << results;
    EXPECT_TRUE(missing_parts_table(results).rows.empty()) << results;
    EXPECT_EQ(map_comparison_text(results), "");
  }
}

}  // namespace
}  // namespace tileflight::report::map_comparison_tables_test
