#include "tileflight/experiments/study/system_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <random>

namespace tileflight::study::system_comparison_test {
namespace {

ScoredRun run(const std::string& system, int place, double score, const std::string& flight = "a") {
  return {.system = system,
          .place = std::to_string(place),
          .flight = flight,
          .kind = {},
          .is_simulated = true,
          .score = score};
}

/// Scores of two systems over places, one flight each.
std::vector<ScoredRun> two_systems(const std::vector<double>& differences) {
  std::vector<ScoredRun> runs;
  for (std::size_t place = 0; place < differences.size(); ++place) {
    runs.push_back(run("a", static_cast<int>(place), 0.5 + differences[place]));
    runs.push_back(run("b", static_cast<int>(place), 0.5));
  }
  return runs;
}

/// Darwin's maize, 15 pairs in eighths of an inch: by Fisher's count (The Design of Experiments, 1935, section 21), 863
/// of the 32 768 choices of signs give a sum at least as large, and as many a sum at least as small.
TEST(CompareSystems, SignsOfDarwinsMaize) {
  const std::vector<double> eighths{49, -67, 8, 16, 6, 23, 28, 41, 14, 29, 56, 24, 75, 60, -48};
  std::vector<double> differences;
  for (const double one : eighths) differences.push_back(one / 1000.0);
  const auto compared = compare_systems(two_systems(differences), 1);
  ASSERT_EQ(compared.size(), 1U);
  EXPECT_EQ(compared[0].better, "a");
  EXPECT_NEAR(compared[0].p, 2.0 * 863.0 / 32768.0, 1e-12);
  EXPECT_NEAR(compared[0].difference, 314.0 / 15000.0, 1e-12);
  EXPECT_FALSE(compared[0].is_real());
}

/// Where all places have the same difference, only the given signs and their opposite are as extreme.
TEST(CompareSystems, EqualDifferencesHaveTheLeastP) {
  const auto compared = compare_systems(two_systems(std::vector<double>(6, -0.1)), 1);
  EXPECT_EQ(compared[0].better, "b");
  EXPECT_NEAR(compared[0].difference, 0.1, 1e-12);
  EXPECT_DOUBLE_EQ(compared[0].p, 2.0 / 64.0);
  EXPECT_TRUE(compared[0].is_real());
  EXPECT_FALSE(compared[0].interval);
  EXPECT_FALSE(compared[0].places_needed);
}

/// Two flights over one place are one sample: twice as many of them change neither p nor what is needed.
TEST(CompareSystems, FlightsOfOnePlaceAreOneSample) {
  const std::vector<double> differences{0.1, 0.3, -0.1, 0.2, 0.25, 0.05, 0.15};
  std::vector<ScoredRun> twice = two_systems(differences);
  for (ScoredRun one : two_systems(differences)) {
    one.flight = "b";
    twice.push_back(one);
  }
  const auto once = compare_systems(two_systems(differences), 1)[0], again = compare_systems(twice, 1)[0];
  EXPECT_EQ(again.flights, 14U);
  EXPECT_EQ(again.places, 7U);
  EXPECT_DOUBLE_EQ(once.p, again.p);
  EXPECT_NEAR((*once.interval)[0], (*again.interval)[0], 1e-12);
  EXPECT_EQ(once.places_needed, again.places_needed);
}

TEST(CompareSystems, OnlyCommonFlightsCountAndRepetitionsAreAveraged) {
  const auto compared = compare_systems({run("a", 1, 0.9), run("a", 1, 0.7), run("a", 2, 0.0), run("b", 1, 0.5)}, 1);
  ASSERT_EQ(compared.size(), 1U);
  EXPECT_NEAR(compared[0].difference, 0.3, 1e-12);
  EXPECT_EQ(compared[0].flights, 1U);
  EXPECT_TRUE(compare_systems({run("a", 1, 0.9), run("b", 2, 0.5)}, 1).empty());
}

/// Holm by hand: p of 0.03125 three times among three pairs: the smallest counts three times, and none less.
TEST(CompareSystems, HolmCountsAllPairs) {
  std::vector<ScoredRun> runs;
  for (int place = 0; place < 6; ++place) {
    runs.push_back(run("a", place, 0.9));
    runs.push_back(run("b", place, 0.6));
    runs.push_back(run("c", place, 0.3));
  }
  const auto compared = compare_systems(runs, 1);
  ASSERT_EQ(compared.size(), 3U);
  EXPECT_EQ(compared[0].better + compared[0].worse, "ac");
  for (const SystemDifference& one : compared) EXPECT_DOUBLE_EQ(one.adjusted_p, 3.0 * 2.0 / 64.0);
  EXPECT_EQ(fewest_places_to_show(3), 7U);
  EXPECT_EQ(fewest_places_to_show(1), 6U);
  EXPECT_EQ(fewest_places_to_show(28), 11U);
}

/// Four systems that are equally good over twelve places whose difficulty differs: at most one study in twenty may name
/// a difference; and 95 % intervals hold the true difference.
TEST(CompareSystems, EqualSystemsAreSeldomCalledDifferentAndIntervalsHold) {
  constexpr int kStudies = 200, kPlaces = 12, kFlights = 4;
  int wrong = 0, held = 0, intervals = 0;
  std::mt19937_64 random(7);
  std::normal_distribution<double> normal;
  for (int study = 0; study < kStudies; ++study) {
    std::vector<ScoredRun> runs;
    for (const std::string system : {"a", "b", "c", "d"}) {
      for (int place = 0; place < kPlaces; ++place) {
        const double here = 0.5 + 0.1 * normal(random);
        for (int flight = 0; flight < kFlights; ++flight)
          runs.push_back(run(system, place, here + 0.05 * normal(random), std::to_string(flight)));
      }
    }
    const auto compared = compare_systems(runs, 1);
    wrong += std::ranges::any_of(compared, &SystemDifference::is_real);
    for (const SystemDifference& one : compared) {
      ++intervals;
      held += one.interval && (*one.interval)[0] <= 0.0 && 0.0 <= (*one.interval)[1];
    }
  }
  EXPECT_LE(wrong, 18) << "of 200; 10 are expected at most, 18 are exceeded by chance once in two hundred";
  EXPECT_GE(held, intervals * 0.92);
  EXPECT_LE(held, intervals * 0.98);
}

/// Studies with as many places as a pilot says find the difference in about four of five cases.
TEST(CompareSystems, ThePlannedNumberOfPlacesHasItsPower) {
  std::mt19937_64 random(11);
  std::normal_distribution<double> normal;
  const auto draw = [&](std::size_t places) {
    std::vector<double> differences(places);
    for (double& one : differences) one = 0.1 + 0.12 * normal(random);
    return differences;
  };
  const auto planned = compare_systems(two_systems(draw(400)), 1)[0].places_needed;
  ASSERT_TRUE(planned);
  EXPECT_NEAR(static_cast<double>(*planned), 14.0, 2.0);  // (t(0.975, 13) + t(0.8, 13))^2 1.44 = 13.3
  int found = 0;
  for (int study = 0; study < 100; ++study) found += compare_systems(two_systems(draw(*planned)), 1)[0].is_real();
  EXPECT_NEAR(found, 80, 12);
}

TEST(CompareSystems, JsonHasNullsWhereNothingIsKnown) {
  const auto json = to_json(compare_systems(two_systems({0.1, 0.1}), 1))[0];
  EXPECT_TRUE(json["interval"][0].is_null());
  EXPECT_TRUE(json["places_needed"].is_null());
  EXPECT_EQ(json["real"], false);
}

}  // namespace
}  // namespace tileflight::study::system_comparison_test
