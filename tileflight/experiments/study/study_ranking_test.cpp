#include "tileflight/experiments/study/study_ranking.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <tuple>

namespace tileflight::study::study_ranking_test {
namespace {

using ::testing::ElementsAre;

ScoredRun run(const std::string& system, const std::string& place, bool simulated, std::optional<double> score) {
  return {.system = system,
          .place = place,
          .flight = simulated ? "/simulated" : "/real",
          .kind = {},
          .is_simulated = simulated,
          .score = score};
}

/// Mean over flights, however many repetitions each has.
TEST(RankSystems, EveryFlightCountsTheSame) {
  const std::vector<RankedSystem> ranking =
      rank_systems({run("a", "x", true, 1.0), run("a", "x", true, 0.0), run("a", "x", true, 0.5),
                    run("a", "y", true, 0.7), run("b", "x", true, 0.9), run("b", "y", true, 0.5)});
  ASSERT_EQ(ranking.size(), 2U);
  EXPECT_EQ(ranking[0].system, "b");
  EXPECT_DOUBLE_EQ(*ranking[0].score, 0.7);
  EXPECT_DOUBLE_EQ(*ranking[1].score, 0.6);
  EXPECT_EQ(ranking[1].flights, 2U);
}

/// Student's t over three places by hand: mean 0.5, standard deviation 0.1, t(0.975, 2) = 4.302653.
TEST(RankSystems, IntervalIsStudentsOverPlaces) {
  const std::vector<RankedSystem> ranking =
      rank_systems({run("a", "x", true, 0.4), run("a", "y", true, 0.5), run("a", "z", true, 0.6)});
  ASSERT_TRUE(ranking[0].interval);
  EXPECT_EQ(ranking[0].interval_over, "places");
  EXPECT_NEAR((*ranking[0].interval)[0], 0.5 - 4.302653 * 0.1 / std::sqrt(3.0), 1e-6);
  EXPECT_NEAR((*ranking[0].interval)[1], 0.5 + 4.302653 * 0.1 / std::sqrt(3.0), 1e-6);
}

TEST(RankSystems, OfOnePlaceTheIntervalIsOverRepetitionsAndOtherwiseThereIsNone) {
  const auto repeated = rank_systems({run("a", "x", true, 0.40), run("a", "x", true, 0.42)});
  EXPECT_EQ(repeated[0].interval_over, "repetitions");
  EXPECT_TRUE(repeated[0].interval);
  EXPECT_FALSE(rank_systems({run("a", "x", true, 0.4), run("a", "x", true, 0.4)})[0].interval)
      << "a deterministic system's repetitions say nothing";
  EXPECT_FALSE(rank_systems({run("a", "x", true, 0.4), run("a", "x", false, 0.5)})[0].interval);
}

TEST(RankSystems, ASystemWithoutScoresIsLastAndHasNone) {
  const auto ranking = rank_systems({run("a", "x", true, std::nullopt), run("b", "x", true, 0.0)});
  EXPECT_EQ(ranking[0].system, "b");
  EXPECT_EQ(ranking[0].score, 0.0);
  EXPECT_FALSE(ranking[1].score);
  EXPECT_TRUE(to_json(ranking)[1]["score"].is_null());
  EXPECT_THAT(to_json(ranking)[1]["interval"], ElementsAre(nullptr, nullptr));
}

std::vector<ScoredRun> runs_with(const std::vector<double>& simulated, const std::vector<double>& real) {
  std::vector<ScoredRun> runs;
  for (std::size_t i = 0; i < simulated.size(); ++i) {
    runs.push_back(run(std::string(1, static_cast<char>('a' + i)), "x", true, simulated[i]));
    runs.push_back(run(std::string(1, static_cast<char>('a' + i)), "x", false, real[i]));
  }
  return runs;
}

/// Of 6 pairs one is discordant: tau = (5 - 1) / 6.
TEST(CompareRanks, TauAndChangedRanks) {
  const auto agreement = compare_ranks(runs_with({0.9, 0.8, 0.5, 0.1}, {0.7, 0.8, 0.4, 0.2}), 1);
  ASSERT_TRUE(agreement);
  EXPECT_EQ(agreement->systems, 4U);
  EXPECT_NEAR(*agreement->tau_b, 4.0 / 6.0, 1e-12);
  EXPECT_FALSE(agreement->interval[0]) << "four systems are too few";
  EXPECT_THAT(agreement->ranks.at("a"), ElementsAre(1, 2));
  EXPECT_THAT(agreement->ranks.at("c"), ElementsAre(3, 3));
  EXPECT_THAT(to_json(*agreement)["rank_changes"], ElementsAre("a", "b"));
  EXPECT_TRUE(compare_ranks(runs_with({0.9, 0.8, 0.7, 0.6, 0.5}, {0.9, 0.8, 0.7, 0.6, 0.5}), 1)->interval[0]);
}

/// Over the second place b is the better one, but nobody flew there in simulation.
TEST(CompareRanks, ComparesTheSamePlaces) {
  std::vector<ScoredRun> runs = runs_with({0.9, 0.5}, {0.9, 0.5});
  runs.push_back(
      {.system = "a", .place = "elsewhere", .flight = "east", .kind = {}, .is_simulated = false, .score = 0.0});
  runs.push_back(
      {.system = "b", .place = "elsewhere", .flight = "east", .kind = {}, .is_simulated = false, .score = 1.0});
  EXPECT_EQ(*compare_ranks(runs, 1)->tau_b, 1.0);
}

/// Over five of six places simulation orders the systems as reality does: a draw without many of the sixth agrees, one
/// with many of it does not.
TEST(CompareRanks, AnIntervalOverPlacesTellsWhatOtherPlacesWouldChange) {
  std::vector<ScoredRun> runs;
  for (int place = 0; place < 6; ++place) {
    const std::string name(1, static_cast<char>('p' + place));
    for (const auto& [system, simulated, real] : {std::tuple("a", 0.9, 0.8), std::tuple("b", 0.6, 0.6)}) {
      runs.push_back(run(system, name, true, simulated));
      runs.push_back(run(system, name, false, place == 5 ? 1.4 - real : real));
    }
  }
  const auto agreement = compare_ranks(runs, 1);
  EXPECT_EQ(agreement->places, 6U);
  EXPECT_EQ(*agreement->tau_b, 1.0);
  ASSERT_TRUE(agreement->interval_over_places[0]);
  EXPECT_EQ(*agreement->interval_over_places[0], -1.0);
  EXPECT_EQ(*agreement->interval_over_places[1], 1.0);
  EXPECT_FALSE(compare_ranks(runs_with({0.9, 0.5}, {0.9, 0.5}), 1)->interval_over_places[0]) << "one place";
}

/// Over orbits simulation predicts, over hovers it does not.
TEST(CompareRanks, EachKindOfFlightHasItsOwnAgreement) {
  std::vector<ScoredRun> orbits = runs_with({0.9, 0.5}, {0.8, 0.4}), hovers = runs_with({0.9, 0.5}, {0.4, 0.8});
  for (ScoredRun& one : orbits) one.kind = "orbit";
  for (ScoredRun& one : hovers) one.kind = "hover", one.flight += "/hover";
  std::vector<ScoredRun> all = orbits;
  all.insert(all.end(), hovers.begin(), hovers.end());
  all.push_back(run("a", "x", true, 0.5));  // of no kind
  const auto by_kind = compare_ranks_by_kind(all, 1);
  ASSERT_EQ(by_kind.size(), 2U);
  EXPECT_EQ(*by_kind.at("orbit").tau_b, 1.0);
  EXPECT_EQ(*by_kind.at("hover").tau_b, -1.0);
}

TEST(CompareRanks, NeedsTwoSystemsWithScoresOnBoth) {
  EXPECT_FALSE(compare_ranks(runs_with({0.9}, {0.7}), 1));
  EXPECT_FALSE(compare_ranks({run("a", "x", true, 0.5), run("b", "x", true, 0.6), run("b", "x", false, 0.6)}, 1));
}

}  // namespace
}  // namespace tileflight::study::study_ranking_test
