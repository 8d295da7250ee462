#include "tileflight/evaluation/metrics/missed_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tileflight/core/base/input_error.h"

namespace tileflight::metrics::missed_places_test {
namespace {

using geometry::Vec3;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// ------------------------------------------------------------------------------------------------ agreement

TEST(Agreement, PhiInClosedForm) {
  EXPECT_DOUBLE_EQ((ContingencyTable{10, 0, 0, 5}.phi()), 1.0);
  EXPECT_DOUBLE_EQ((ContingencyTable{0, 3, 7, 0}.phi()), -1.0);
  EXPECT_DOUBLE_EQ((ContingencyTable{6, 2, 3, 1}.phi()), 0.0) << "independent";
  EXPECT_DOUBLE_EQ((ContingencyTable{4, 1, 2, 3}.phi()), (12.0 - 2.0) / std::sqrt(5.0 * 5.0 * 6.0 * 4.0));
  EXPECT_TRUE(std::isnan((ContingencyTable{0, 0, 3, 5}.phi()))) << "simulation lost nothing";
  EXPECT_TRUE(std::isnan(ContingencyTable{}.phi()));
}

TEST(Agreement, PhiIsPearsonsCorrelation) {
  std::mt19937_64 random(1);
  ContingencyTable table;
  double n = 0, sa = 0, sb = 0, sab = 0;
  for (int k = 0; k < 500; ++k) {
    const bool a = random() % 3 == 0, b = random() % 2 == 0 ? a : random() % 5 == 0;
    table.add(a, b);
    n += 1;
    sa += a;
    sb += b;
    sab += a && b;
  }
  const double expected = (sab / n - sa / n * sb / n) / std::sqrt(sa / n * (1 - sa / n) * sb / n * (1 - sb / n));
  EXPECT_NEAR(table.phi(), expected, 1e-12);
  EXPECT_EQ(table.total(), 500u);
}

TEST(Agreement, SharesAreOfWhatHappened) {
  const auto json = to_json(ContingencyTable{3, 1, 2, 10});
  EXPECT_DOUBLE_EQ(json.at("predicted"), 0.6);
  EXPECT_DOUBLE_EQ(json.at("false_alarms"), 0.25);
  EXPECT_TRUE(to_json(ContingencyTable{0, 0, 0, 9}).at("predicted").is_null());
  EXPECT_NE(to_json(ContingencyTable{0, 0, 0, 9}).dump().find("\"phi\":null"), std::string::npos);
}

// Answers are signs of normal variables that share one part in a block; their correlation r gives phi = 2/pi asin r
// (Sheppard 1899).
TEST(Agreement, IntervalCoversTheTruthAsOftenAsItSays) {
  std::mt19937_64 random(2);
  std::normal_distribution<double> normal(0.0, 1.0);
  const double truth = 2.0 / std::acos(-1.0) * std::asin(0.5);
  int covered = 0;
  for (std::uint64_t k = 0; k < 1000; ++k) {
    std::vector<ContingencyTable> blocks(80);
    for (ContingencyTable& block : blocks) {
      const double shared = normal(random);
      for (int cell = 0; cell < 8; ++cell) block.add(shared + normal(random) > 0, shared + normal(random) > 0);
    }
    const auto ci = phi_interval(blocks, 300, k);
    covered += ci[0] <= truth && truth <= ci[1];
  }
  EXPECT_GE(covered, 930);
  EXPECT_LE(covered, 970);
}

TEST(Agreement, TooLittleHasNoInterval) {
  EXPECT_TRUE(std::isnan(phi_interval({}, 100, 1)[0]));
  EXPECT_TRUE(std::isnan(phi_interval({ContingencyTable{1, 1, 1, 1}}, 100, 1)[0]));
  EXPECT_TRUE(std::isnan(phi_interval({ContingencyTable{1, 1, 1, 1}, ContingencyTable{0, 0, 0, 9}}, 100, 1)[0]));
}

// ------------------------------------------------------------------------------------------------ places

/// Two samples in each of the cells from..to of a row of 2 m cells; those from `mapped_from` on are near the map.
SeenSurface row(int from, int to, int mapped_from) {
  SeenSurface surface;
  for (int cell = from; cell < to; ++cell) {
    for (const double x : {0.5, 1.5}) {
      surface.positions.push_back({2.0 * cell + x, 1.0, 1.0});
      surface.map_distance_m.push_back(cell >= mapped_from ? 0.2 : 3.0);
    }
  }
  return surface;
}

TEST(MissedPlaces, CountsWhatBothSawAndEachMissed) {
  const MissedPlaces places = missed_places(row(0, 10, 4), row(-3, 8, 2));
  ASSERT_EQ(places.cells.size(), 8u) << "0 to 7";
  EXPECT_EQ(places.seen_alone, (std::array<std::size_t, 2>{2, 3}));
  EXPECT_EQ(places.missed.both, 2u);
  EXPECT_EQ(places.missed.only_simulated, 2u);
  EXPECT_EQ(places.missed.only_real, 0u);
  EXPECT_EQ(places.missed.neither, 4u);
  EXPECT_NEAR((places.cells[0].center - Vec3(1, 1, 1)).norm(), 0.0, 1e-12);
  EXPECT_EQ(to_json(places).at("missed").at("predicted"), 1.0);
  EXPECT_EQ(to_json(places).at("missed").at("false_alarms"), 0.5);
}

TEST(MissedPlaces, HalfOfTheSamplesMakeACellMapped) {
  SeenSurface half = row(0, 1, 0), quarter;
  half.map_distance_m[0] = 1.5;
  quarter = row(0, 1, 0);
  quarter.positions.insert(quarter.positions.end(), 2, quarter.positions[0]);
  quarter.map_distance_m = {0.5, 1.5, 1.0001, 7.0};
  const MissedPlaces places = missed_places(half, quarter);
  ASSERT_EQ(places.cells.size(), 1u);
  EXPECT_FALSE(places.cells[0].missed(0));
  EXPECT_TRUE(places.cells[0].missed(1));
}

TEST(MissedPlaces, CsvHasALineACell) {
  const std::string csv = missed_places_csv(missed_places(row(-1, 3, 1), row(-1, 3, 0)));
  EXPECT_EQ(std::ranges::count(csv, '\n'), 5);
  EXPECT_NE(csv.find("\n-1.000,1.000,1.000,2,0,2,0,both\n1.000,1.000,1.000,2,0,2,2,simulated\n3.000"),
            std::string::npos)
      << csv;
}

TEST(MissedPlaces, NothingInCommonIsADefinedResult) {
  const MissedPlaces places = missed_places(row(0, 3, 0), row(10, 12, 0));
  EXPECT_TRUE(places.cells.empty());
  EXPECT_TRUE(std::isnan(places.missed.phi()));
  EXPECT_EQ(missed_places({}, {}).missed.total(), 0u);
}

TEST(MissedPlaces, RefusesBadInput) {
  EXPECT_THAT(
      [&] {
        missed_places({{Vec3::Zero()}, {}}, {});
      },
      ThrowsMessage<InputError>(HasSubstr("the number of distances differs")));
  EXPECT_THAT([&] { missed_places({}, {}, {.cell_m = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("cell of the missed-places map: must be above zero")));
  EXPECT_THAT([&] { missed_places({}, {}, {.cell_m = 3.0, .block_m = 2.0}); },
              ThrowsMessage<InputError>(HasSubstr("block of the bootstrap: must be at least one cell")));
}

}  // namespace
}  // namespace tileflight::metrics::missed_places_test
