#include "tileflight/evaluation/metrics/map_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "tests/refusal.h"
#include "tests/synthetic_maps.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"

namespace tileflight::metrics::map_comparison_test {
namespace {

using geometry::TriangleIndex;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;
using tests::MapKind;
using tests::SyntheticPlace;

/// A place with quantities used by several tests.
struct CellIndex {
  SyntheticPlace truth;
  TriangleIndex surface;

  explicit CellIndex(std::uint64_t seed, double side_m = 100.0) : truth(seed, side_m), surface(truth.mesh()) {}

  ScoredMap map(const MapKind& kind, std::uint64_t seed) const {
    return tests::scored(truth, surface, tests::synthetic_map(truth, kind, seed));
  }
};

const CellIndex& place() {
  static const CellIndex made(1);
  return made;
}

const ComparedMetric& number(const MapComparison& c, std::string_view name) {
  const auto found = std::ranges::find(c.metrics, name, &ComparedMetric::name);
  if (found == c.metrics.end()) throw InputError(std::string(name), "is not compared");
  return *found;
}

MapComparison compared(const ScoredMap& simulated, const ScoredMap& real, std::uint64_t seed = 1) {
  return compare_maps({simulated}, {real}, {.resamples = 400, .seed = seed});
}

TEST(MapComparison, NumbersAreThoseOfTheWholeMaps) {
  ScoredMap a = place().map({}, 1), b = place().map({.points = 6000, .noise_m = 0.08}, 2);
  a.ate_rmse_m = 0.02;
  b.ate_rmse_m = 0.05;
  const MapComparison c = compared(a, b);
  const auto share = [](const std::vector<double>& distances, double t) {
    return static_cast<double>(std::count_if(distances.begin(), distances.end(), [&](double d) { return d <= t; })) /
           static_cast<double>(distances.size());
  };
  EXPECT_EQ(number(c, "surface.median").simulated, compute_statistics(a.surface.distances).median);
  EXPECT_EQ(number(c, "surface.median").real, compute_statistics(b.surface.distances).median);
  EXPECT_NEAR(number(c, "surface.median").ratio,
              compute_statistics(a.surface.distances).median / compute_statistics(b.surface.distances).median, 1e-12);
  std::vector<double> kept = a.surface.distances;
  std::erase_if(kept, [](double d) { return d > 1.0; });
  EXPECT_NEAR(number(c, "surface.rms").simulated, compute_statistics(kept).rmse, 1e-12);
  EXPECT_EQ(number(c, "surface.within_0.1").real, share(b.surface.distances, 0.1));
  EXPECT_NEAR(number(c, "surface.beyond_1").real, 1.0 - share(b.surface.distances, 1.0), 1e-12);
  EXPECT_EQ(number(c, "completeness.within_0.2").simulated, share(a.seen.map_distance_m, 0.2));
  EXPECT_EQ(number(c, "completeness.within_0.1").real, share(b.seen.map_distance_m, 0.1));
  EXPECT_FALSE(number(c, "completeness.within_0.1").is_decisive);
  const MissingParts missing = missing_parts(a.surface, a.seen, b.surface, b.seen);
  EXPECT_EQ(number(c, "completeness.lacking").simulated, missing.lacking_share(0));
  EXPECT_EQ(number(c, "completeness.lacking").real, missing.lacking_share(1));
  EXPECT_EQ(number(c, "path.ate").real, 0.05);
  EXPECT_EQ(number(c, "path.ate").sampling_unit, "one path");
  ASSERT_TRUE(c.surface_blocks && c.completeness_blocks);
  EXPECT_GE(c.surface_blocks->effective, 30.0);
}

TEST(MapComparison, ExchangedMapsTurnTheSign) {
  const ScoredMap a = place().map({}, 1), b = place().map({.noise_m = 0.08}, 2);
  const MapComparison forward = compared(a, b), backward = compared(b, a);
  ASSERT_FALSE(forward.metrics.empty());
  for (const ComparedMetric& f : forward.metrics) {
    const ComparedMetric& r = number(backward, f.name);
    EXPECT_NEAR(f.difference, -r.difference, 1e-12) << f.name;
    // Where a bootstrap sample lacks nothing, the ratio has no interval.
    EXPECT_EQ(std::isnan(f.ratio_ci95[0]), std::isnan(r.ratio_ci95[1])) << f.name;
    if (!std::isnan(f.ratio_ci95[0])) {
      EXPECT_NEAR(f.ratio_ci95[0] * r.ratio_ci95[1], 1.0, 1e-9) << f.name;
    }
    EXPECT_NEAR(f.p_within, r.p_within, 1e-9) << f.name;
    EXPECT_EQ(f.verdict, r.verdict) << f.name;
  }
  EXPECT_EQ(forward.verdict.word, backward.verdict.word);
}

TEST(MapComparison, TheSameMapTwiceIsEquivalent) {
  const ScoredMap a = place().map({}, 1);
  const MapComparison c = compared(a, a);
  EXPECT_EQ(c.verdict.word, "equivalent");
  ASSERT_FALSE(c.metrics.empty());
  for (const ComparedMetric& m : c.metrics) EXPECT_EQ(m.difference_ci95, (std::array{0.0, 0.0})) << m.name;
}

TEST(MapComparison, ADrawnMedianIsThatOfTheDrawnPoints) {
  // One draw of all blocks is the map itself: bins, linear between, against the exact median.
  const ScoredMap a = place().map({}, 1), b = place().map({.noise_m = 0.3}, 2);
  const ComparedMetric m = number(compared(a, b), "surface.median");
  const double middle = std::sqrt(m.ratio_ci95[0] * m.ratio_ci95[1]);
  EXPECT_NEAR(middle / m.ratio, 1.0, 1e-9);
  EXPECT_LT(m.ratio_ci95[1] / m.ratio_ci95[0], 1.5);
}

TEST(MapComparison, BlocksThatOneMapAloneReachesAddToThatOneAlone) {
  const ScoredMap a = place().map({}, 1);
  ScoredMap half = place().map({}, 2), shifted = half;
  KeptDistances west;
  for (std::size_t i = 0; i < half.surface.positions.size(); ++i) {
    if (half.surface.positions[i].x() > 50.0) continue;
    west.positions.push_back(half.surface.positions[i]);
    west.distances.push_back(half.surface.distances[i]);
  }
  half.surface = west;
  const MapComparison c = compared(a, half);
  EXPECT_GT(c.surface_blocks->exclusive[0], 5u);
  EXPECT_LE(c.surface_blocks->exclusive[1], 2u);
  EXPECT_EQ(number(c, "surface.median").real, compute_statistics(west.distances).median);
  EXPECT_NE(number(c, "surface.median").verdict, "different");
}

TEST(MapComparison, WhatIsLackingIsOfWhatBothCamerasSaw) {
  const ScoredMap a = place().map({}, 1);
  ScoredMap b = place().map({}, 2);
  SeenSurface part;
  for (std::size_t i = 0; i < b.seen.positions.size(); ++i) {
    if (b.seen.positions[i].y() > 60.0) continue;
    part.positions.insert(part.positions.begin(), b.seen.positions[i]);  // in another order
    part.map_distance_m.insert(part.map_distance_m.begin(), b.seen.map_distance_m[i]);
  }
  b.seen = part;
  const MissingParts missing = missing_parts(a.surface, a.seen, b.surface, b.seen);
  EXPECT_EQ(missing.shared_samples.size(), part.positions.size());
  EXPECT_EQ(number(compared(a, b), "completeness.lacking").real, missing.lacking_share(1));
  for (geometry::Vec3& p : b.seen.positions) p.z() += 1e-9;  // another truth: no common samples
  EXPECT_TRUE(std::isnan(number(compared(a, b), "completeness.lacking").real));
}

TEST(MapComparison, RunsAreTheUnitWhereThereAreRuns) {
  std::vector<ScoredMap> simulated, real;
  std::vector<double> medians[2], logs[2], ates[2];
  for (std::uint64_t k = 0; k < 4; ++k) {
    simulated.push_back(place().map({}, 10 + k));
    real.push_back(place().map({.noise_m = 0.1}, 20 + k));
    simulated.back().ate_rmse_m = 0.02 + 0.001 * static_cast<double>(k);
    real.back().ate_rmse_m = 0.5 + 0.02 * static_cast<double>(k);
    int flight = 0;
    for (const auto* map : {&simulated.back(), &real.back()}) {
      medians[flight].push_back(compute_statistics(map->surface.distances).median);
      logs[flight].push_back(std::log(medians[flight].back()));
      ates[flight].push_back(*map->ate_rmse_m);
      ++flight;
    }
  }
  const MapComparison c = compare_maps(simulated, real, {.resamples = 400});
  const ComparedMetric& m = number(c, "surface.median");
  const RunDifference difference = welch_difference(medians[0], medians[1]), ratio = welch_difference(logs[0], logs[1]);
  EXPECT_EQ(m.sampling_unit, "runs");
  EXPECT_NEAR(m.difference_ci95[0], difference.ci95[0], 1e-9);
  EXPECT_NEAR(m.ratio_ci95[1], std::exp(ratio.ci95[1]), 1e-9);
  EXPECT_NEAR(number(c, "path.ate").difference_ci95[1], welch_difference(ates[0], ates[1]).ci95[1], 1e-9);
  EXPECT_EQ(number(c, "path.ate").verdict, "different") << "what one path each cannot show";
  EXPECT_EQ(c.verdict.word, "different");
  EXPECT_EQ(number(compare_maps({simulated[0], simulated[0]}, {real[0], real[0]}, {.resamples = 400}), "surface.median")
                .sampling_unit,
            "blocks")
      << "runs that were all alike are none";
}

TEST(MapComparison, WhatIsNotKnownIsLeftOut) {
  ScoredMap a = place().map({}, 1), b = place().map({}, 2);
  a.seen = {};
  const json object = to_json(DistanceComparison{}, compared(a, b));
  EXPECT_TRUE(object["completeness"].is_null());
  EXPECT_TRUE(object["path"].is_null());
  EXPECT_EQ(object["verdict_on"], json({"surface.median", "surface.rms", "surface.within_0.1", "surface.beyond_1"}));
  const json published = to_json(DistanceComparison{.verdict = "equivalent"}, std::nullopt);
  EXPECT_EQ(published["verdict"], "equivalent");
  EXPECT_EQ(published["verdict_on"], json({"mean_difference"}));
  EXPECT_TRUE(published["surface"].is_null());
}

TEST(MapComparison, FewPointsGiveNoIntervalAndDecideNothing) {
  ScoredMap few{.surface = {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {0.1, 0.2, 0.3}, 3}};
  const MapComparison c = compared(few, few);
  EXPECT_EQ(c.verdict.word, "undecided");
  EXPECT_TRUE(std::isnan(number(c, "surface.median").ratio_ci95[0]));
  EXPECT_EQ(number(c, "surface.median").ratio, 1.0);
  ScoredMap one{.surface = {{{0, 0, 0}}, {0.0}, 1}};
  EXPECT_EQ(compared(one, one).verdict.word, "undecided") << "all in one place, and no error at all";
}

TEST(MapComparison, KeysOfOneNumber) {
  const json object = to_json(DistanceComparison{}, compared(place().map({}, 1), place().map({}, 2)));
  for (const char* key : {"simulated", "real", "difference", "ci95", "ratio", "ratio_ci95", "margin", "verdict"})
    EXPECT_TRUE(object["surface"]["median"].contains(key)) << key;
  for (const char* key : {"median", "rms", "within_0.1", "beyond_1", "blocks"})
    EXPECT_TRUE(object["surface"].contains(key)) << key;
  EXPECT_TRUE(object["completeness"].contains("within_0.2"));
  EXPECT_TRUE(object.contains("mean_difference_ci95"));
}

TEST(MapComparison, SameBitsForAnyNumberOfThreads) {
  const ScoredMap a = place().map({}, 1), b = place().map({.noise_m = 0.07}, 2);
  const std::string first = to_json(DistanceComparison{}, compared(a, b)).dump();
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(to_json(DistanceComparison{}, compared(a, b)).dump(), first);
  EXPECT_NE(to_json(DistanceComparison{}, compared(a, b, 2)).dump(), first);
}

TEST(MapComparison, RefusesBadInput) {
  const ScoredMap a = place().map({}, 1);
  EXPECT_THAT([&] { compare_maps({}, {a}); },
              ThrowsMessage<InputError>(HasSubstr("needs at least one run of each flight")));
  EXPECT_EQ(tests::refusal_of([&] { compare_maps({a}, {{}}); }),
            "real flight: no map point lies over the truth's surface");
  EXPECT_THAT([&] { compare_maps({a}, {a}, {.ratio_margin = 1.0}); },
              ThrowsMessage<InputError>(HasSubstr("margin of a ratio: must be above one")));
  EXPECT_THAT([&] { compare_maps({a}, {a}, {.share_margin = 0.0}); },
              ThrowsMessage<InputError>(HasSubstr("margin: must be above zero")));
  EXPECT_THAT([&] { compare_maps({a}, {a}, {.resamples = 3}); },
              ThrowsMessage<InputError>(HasSubstr("resamples of the bootstrap: must be at least 100")));
}

// ------------------------------------------------------------------------------------------------------------ power
// A short form of verdict_power_benchmark: 20 independent places, with fixed seeds.

constexpr std::uint64_t kPlaces = 20;

/// How often each verdict came out, and each reason.
struct Counts {
  int different = 0, equivalent = 0;
  std::map<std::string, int> because;
  std::map<std::string, int> held;  ///< intervals that contained the true value
};

Counts count(const MapKind& first, const MapKind& second,
             double true_ratio = std::numeric_limits<double>::quiet_NaN()) {
  Counts counts;
  for (std::uint64_t k = 0; k < kPlaces; ++k) {
    const CellIndex here(100 + k);
    const MapComparison c = compared(here.map(first, 2 * k), here.map(second, 2 * k + 1), k);
    counts.different += c.verdict.word == "different";
    counts.equivalent += c.verdict.word == "equivalent";
    if (c.verdict.word == "different")
      for (const std::string& name : c.verdict.reasons) ++counts.because[name];
    for (const ComparedMetric& m : c.metrics)
      counts.held[m.name] += m.ratio_ci95[0] <= true_ratio && true_ratio <= m.ratio_ci95[1];
  }
  return counts;
}

TEST(VerdictPower, MapsOfOneKindAreNotCalledDifferent) {
  const Counts counts = count({}, {}, 1.0);
  EXPECT_LE(counts.different, 1);
  for (const char* name : {"surface.median", "surface.rms", "completeness.within_0.2"}) {
    EXPECT_GE(counts.held.at(name), 17) << name;
  }
}

TEST(VerdictPower, TwiceTheNoiseIsToldApart) {
  const Counts counts = count({.noise_m = 0.1}, {}, 2.0);
  EXPECT_GE(counts.different, 19);
  EXPECT_GE(counts.because.at("surface.median"), 19);
  EXPECT_GE(counts.held.at("surface.median"), 17);
}

TEST(VerdictPower, OneHoleIsListedAndIsNoVerdictOnTheKind) {
  // If maps of the same kind have occasional holes, these occur in either map equally often.
  const CellIndex here(300, 60.0);
  const MapKind whole{.points = 40000, .gaps = 0.0};
  ScoredMap a = here.map(whole, 1), b = here.map(whole, 2);
  const geometry::Vec3 hole = here.truth.samples()[2000];
  const auto in_hole = [&](const geometry::Vec3& p) { return (p - hole).norm() < 2.5; };
  geometry::PointCloud left;
  for (const geometry::Vec3& p : b.surface.positions)
    if (!in_hole(p)) left.positions.push_back(p);
  b = tests::scored(here.truth, here.surface, left);
  const MapComparison c = compared(a, b);
  ASSERT_FALSE(c.missing->parts.empty());
  EXPECT_LT((c.missing->parts[0].center - hole).norm(), 2.5);
  EXPECT_EQ(c.missing->parts[0].lacking_map, 1u);
  EXPECT_NE(number(c, "completeness.lacking").verdict, "different");
}

TEST(VerdictPower, FivePercentOfTheSurfaceMissingIsToldApart) {
  Counts counts = count({.points = 20000, .missing_share = 0.05}, {.points = 20000});
  EXPECT_GE(counts.because["completeness.lacking"], 17);
  for (const char* name : {"surface.median", "surface.rms", "surface.within_0.1", "surface.beyond_1"})
    EXPECT_EQ(counts.because[name], 0) << name << ": what is left is as good as before";
}

}  // namespace
}  // namespace tileflight::metrics::map_comparison_test
