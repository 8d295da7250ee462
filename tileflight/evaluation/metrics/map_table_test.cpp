#include "tileflight/evaluation/metrics/map_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/distances.h"

namespace tileflight::metrics::map_table_test {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

/// Errors of 300 points along a road, about a mean.
ComparedMap some_map(const std::string& name, double mean_m, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> error(mean_m, 0.05);
  KeptDistances kept;
  for (int k = 0; k < 300; ++k) {
    kept.positions.push_back({1.0 * k, 0, 0});
    kept.distances.push_back(error(random));
  }
  kept.points = 400;
  ComparedMap map{name, {}, {kept}};
  std::vector<double> all = kept.distances;
  all.resize(400, 9.0);
  map.metrics.map = score_map(all, {}, {});
  return map;
}

std::vector<ComparedMap> three_maps() {
  return {some_map("out/a_1", 0.50, 1), some_map("b, \"second\"", 0.51, 2), some_map("c", 0.70, 3)};
}

int lines_of(const std::string& text) { return static_cast<int>(std::ranges::count(text, '\n')); }

TEST(MapTable, EveryPairIsComparedAsTwoMapsAre) {
  const auto maps = three_maps();
  const auto pairs = compare_all_pairs(maps);
  ASSERT_EQ(pairs.size(), 3u);
  EXPECT_EQ(pairs[1].first, 0u);
  EXPECT_EQ(pairs[1].second, 2u);
  EXPECT_EQ(to_json(pairs[1].comparison), to_json(compare_distances(maps[0].runs[0], maps[2].runs[0])));
  EXPECT_EQ(pairs[0].comparison.verdict, "equivalent");
  EXPECT_EQ(pairs[1].comparison.verdict, "different");
  for (const ComparedPair& pair : pairs) {
    EXPECT_LT(pair.simultaneous_ci95[0], pair.comparison.mean_difference_ci95[0]) << "of three pairs together";
    EXPECT_GT(pair.simultaneous_ci95[1], pair.comparison.mean_difference_ci95[1]);
  }
  const auto alone = compare_all_pairs({maps[0], maps[1]});
  EXPECT_EQ(alone[0].simultaneous_ci95, alone[0].comparison.mean_difference_ci95) << "one pair needs no correction";
}

TEST(MapTable, AWarningOfEitherMapWithholdsTheVerdict) {
  auto maps = three_maps();
  maps[1].metrics.warnings = {{"lost at frame 90", "odometry", Severity::kError, "look"},
                              {"coarse", "truth", Severity::kWarning, "refine"}};
  maps[0].metrics.warnings = {{"coarse", "truth", Severity::kWarning, "refine"}};
  maps[2].metrics.warnings = {{"few keyframes", "alignment", Severity::kNote, "fly farther"}};
  const auto pairs = compare_all_pairs(maps);
  const nlohmann::json object = to_json(maps, pairs);
  const nlohmann::json& first = object["pairs"][0];
  EXPECT_EQ(first["verdict"], "withheld");
  EXPECT_EQ(first["verdict_without_warnings"], "equivalent");
  ASSERT_EQ(first["verdict_withheld_by"].size(), 2u) << "the truth's once";
  EXPECT_EQ(first["verdict_withheld_by"][1]["where"], maps[1].name + "/odometry");
  EXPECT_THAT(pairs_csv(maps, pairs), HasSubstr(",withheld\r\n"));
  for (ComparedMap& map : maps) std::erase_if(map.metrics.warnings, forbids_verdict);
  EXPECT_EQ(to_json(maps, compare_all_pairs(maps))["pairs"][1]["verdict"], "different")
      << "a note stands beside the verdict";
}

TEST(MapTable, SimultaneousIntervalsHoldTogetherAsOftenAsTheySay) {
  int all_hold = 0;
  for (std::uint64_t k = 0; k < 300; ++k) {
    bool hold = true;
    const std::vector<ComparedMap> maps{some_map("a", 0.5, 4 * k), some_map("b", 0.5, 4 * k + 1),
                                        some_map("c", 0.5, 4 * k + 2), some_map("d", 0.5, 4 * k + 3)};
    for (const ComparedPair& pair : compare_all_pairs(maps, {.resamples = 1000, .seed = k}))
      hold = hold && pair.simultaneous_ci95[0] <= 0.0 && 0.0 <= pair.simultaneous_ci95[1];
    all_hold += hold;
  }
  EXPECT_GE(all_hold, 275) << "of 300; at least 95 %, Bonferroni errs to the safe side";
}

TEST(MapTable, CsvHasALineEachAndQuotesNames) {
  const auto maps = three_maps();
  const std::string csv = maps_csv(maps), pairs = pairs_csv(maps, compare_all_pairs(maps));
  EXPECT_EQ(lines_of(csv), 4);
  EXPECT_EQ(lines_of(pairs), 4);
  EXPECT_THAT(csv, HasSubstr("\r\n\"b, \"\"second\"\"\",1,400,300,0.750000,"));
  EXPECT_THAT(pairs, HasSubstr(",blocks,"));
  const std::string head = csv.substr(0, csv.find('\r')), line = csv.substr(csv.rfind("\nc,") + 1);
  EXPECT_EQ(std::ranges::count(head, ','), std::ranges::count(line, ',')) << "unknown numbers are empty fields";
  EXPECT_THAT(line, HasSubstr(",,"));
}

TEST(MapTable, LatexIsTwoTabularsWithNamesEscaped) {
  const auto maps = three_maps();
  const std::string tex = tables_tex(maps, compare_all_pairs(maps));
  EXPECT_THAT(tex, HasSubstr("out/a\\_1 & 400 & 0.750 & 0.5"));
  EXPECT_THAT(tex, HasSubstr(" & -- "));
  EXPECT_THAT(tex, HasSubstr(" & different \\\\"));
  for (const char* word : {"\\begin{tabular}", "\\end{tabular}", "\\toprule", "\\bottomrule"}) {
    const std::size_t first = tex.find(word);
    EXPECT_NE(tex.find(word, first + 1), std::string::npos) << word;
  }
}

TEST(MapTable, JsonHasMapsAndPairs) {
  const auto maps = three_maps();
  const auto json = to_json(maps, compare_all_pairs(maps));
  EXPECT_EQ(json.at("maps").size(), 3u);
  EXPECT_EQ(json.at("maps")[2].at("name"), "c");
  EXPECT_TRUE(json.at("maps")[2].at("surface_median_m").is_null());
  EXPECT_EQ(json.at("pairs")[2].at("second"), "c");
  EXPECT_TRUE(json.at("pairs")[2].contains("mean_difference_ci95"));
}

TEST(MapTable, AgainstABaselineFiftyMapsAreFortyNinePairs) {
  const auto maps = three_maps();
  const auto pairs = compare_all_pairs(maps, {}, {}, 1);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].first, 0u);
  EXPECT_EQ(pairs[1].first, 2u);
  for (const ComparedPair& pair : pairs) EXPECT_EQ(pair.second, 1u);
  EXPECT_EQ(to_json(pairs[0].comparison), to_json(compare_distances(maps[0].runs[0], maps[1].runs[0])));
  const auto all = compare_all_pairs(maps);
  EXPECT_LT(pairs[0].simultaneous_ci95[1] - pairs[0].simultaneous_ci95[0],
            all[0].simultaneous_ci95[1] - all[0].simultaneous_ci95[0])
      << "fewer pairs need a smaller correction";
  std::vector<ComparedMap> many;
  for (int k = 0; k < 50; ++k) many.push_back(some_map(std::to_string(k), 0.5, static_cast<std::uint64_t>(k)));
  EXPECT_EQ(compare_all_pairs(many, {.resamples = 100}, {}, 7).size(), 49u);
}

TEST(MapTable, ColumnsAreChosenByKeyOrByPath) {
  auto maps = three_maps();
  maps[0].metrics.map.distances.mean = 0.25;
  const auto columns = choose_columns({"mean_m", "runs", "map.share_kept", "ate_rmse_m"}, maps);
  const std::string csv = maps_csv(maps, columns);
  EXPECT_THAT(csv, HasSubstr("name,mean_m,runs,map.share_kept,ate_rmse_m\r\nout/a_1,0.250000,1,0.750000,\r\n"));
  EXPECT_THAT(tables_tex(maps, {}, columns), HasSubstr("Map & Mean, m & Runs & map.share\\_kept & ATE, m \\\\"));
  EXPECT_THAT(tables_tex(maps, {}, columns), HasSubstr("out/a\\_1 & 0.2500 & 1 & 0.7500 & -- \\\\"));
  EXPECT_EQ(to_json(maps, {}, columns)["maps"][0]["map.share_kept"], 0.75);
  EXPECT_THAT(
      [&] {
        choose_columns({"mean_m", "ate_rsme"}, maps);
      },
      ThrowsMessage<InputError>(HasSubstr("column 'ate_rsme': is neither known nor a number of metrics.json; "
                                          "did you mean 'ate_rmse_m'?")));
  EXPECT_THAT([&] { choose_columns({"map.meen"}, maps); }, ThrowsMessage<InputError>(HasSubstr("'map.mean'?")));
}

TEST(MapTable, TextIsAligned) {
  auto maps = three_maps();
  for (ComparedMap& map : maps) map.metrics.map.distances.mean = 12.5;
  const std::string text = maps_text(maps, choose_columns({"mean_m", "points", "entropy"}, maps));
  EXPECT_EQ(text,
            "map           mean_m  points  entropy\n"
            "out/a_1      12.5000     400        -\n"
            "b, \"second\"  12.5000     400        -\n"
            "c            12.5000     400        -\n");
}

TEST(MapTable, RefusesBadInput) {
  EXPECT_THAT([&] { compare_all_pairs({}); }, ThrowsMessage<InputError>(HasSubstr("needs at least two maps")));
  EXPECT_THAT([&] { compare_all_pairs({some_map("a", 0.5, 1)}); },
              ThrowsMessage<InputError>(HasSubstr("needs at least two maps")));
  EXPECT_THAT(
      [&] {
        compare_all_pairs({some_map("a", 0.5, 1), ComparedMap{"empty", {}, {KeptDistances{}}}});
      },
      ThrowsMessage<InputError>(HasSubstr("real run: no map point lies within the cut-off")));
}

}  // namespace
}  // namespace tileflight::metrics::map_table_test
