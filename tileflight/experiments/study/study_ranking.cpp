#include "tileflight/experiments/study/study_ranking.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"
#include "tileflight/evaluation/metrics/rank_correlation.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"

namespace tileflight::study {
namespace {

using nlohmann::json;

double mean_of(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

/// Scores by place and flight.
using Scores = std::map<std::string, std::map<std::string, std::vector<double>>>;

Scores scores_of(const std::vector<ScoredRun>& runs, const std::string& system) {
  Scores scores;
  for (const ScoredRun& run : runs) {
    if (run.system == system && run.score) scores[run.place][run.flight].push_back(*run.score);
  }
  return scores;
}

RankedSystem rank_one(const std::vector<ScoredRun>& runs, const std::string& system) {
  RankedSystem ranked{.system = system, .score = std::nullopt, .interval = std::nullopt};
  std::vector<double> flight_means, place_means, repetitions;
  for (const auto& [place, flights] : scores_of(runs, system)) {
    std::vector<double> of_place;
    for (const auto& [flight, scores] : flights) {
      of_place.push_back(mean_of(scores));
      repetitions = scores;
    }
    flight_means.insert(flight_means.end(), of_place.begin(), of_place.end());
    place_means.push_back(mean_of(of_place));
  }
  ranked.places = place_means.size();
  ranked.flights = flight_means.size();
  if (flight_means.empty()) return ranked;
  ranked.score = mean_of(flight_means);
  const bool by_places = place_means.size() > 1;
  if (!by_places && flight_means.size() > 1) return ranked;  // two flights over one place are no sample of anything
  const metrics::RunSpread spread = metrics::compute_run_spread(by_places ? place_means : repetitions);
  if (!std::isfinite(spread.ci95[0])) return ranked;
  ranked.interval = {std::clamp(spread.ci95[0], 0.0, 1.0), std::clamp(spread.ci95[1], 0.0, 1.0)};
  ranked.interval_over = by_places ? "places" : "repetitions";
  return ranked;
}

std::vector<std::string> system_names(const std::vector<ScoredRun>& runs) {
  std::set<std::string> names;
  for (const ScoredRun& run : runs) names.insert(run.system);
  return {names.begin(), names.end()};
}

/// Mean scores of systems, by place: sums over its flights, each the mean of its repetitions.
struct PlaceScores {
  std::vector<double> sums, counts;  ///< a system each
};

std::vector<PlaceScores> place_scores(const std::vector<ScoredRun>& runs, const std::vector<std::string>& systems,
                                      const std::vector<std::string>& places) {
  std::vector<PlaceScores> result(places.size());
  for (const std::string& system : systems) {
    Scores scores = scores_of(runs, system);
    for (std::size_t p = 0; p < places.size(); ++p) {
      double sum = 0.0;
      for (const auto& [flight, values] : scores[places[p]]) sum += mean_of(values);
      result[p].sums.push_back(sum);
      result[p].counts.push_back(static_cast<double>(scores[places[p]].size()));
    }
  }
  return result;
}

/// Mean scores of the systems over drawn places; nullopt if one of them has none there.
std::optional<std::vector<double>> mean_scores(const std::vector<PlaceScores>& places,
                                               const std::vector<std::size_t>& drawn) {
  std::vector<double> means;
  for (std::size_t system = 0; system < places.front().sums.size(); ++system) {
    double sum = 0.0, count = 0.0;
    for (const std::size_t p : drawn) sum += places[p].sums[system], count += places[p].counts[system];
    if (count == 0.0) return std::nullopt;
    means.push_back(sum / count);
  }
  return means;
}

/// Bootstraps the agreement of two sides over their common places; nullopt below five places.
std::array<std::optional<double>, 2> tau_over_places(const std::vector<PlaceScores>& simulated,
                                                     const std::vector<PlaceScores>& real, std::uint64_t seed) {
  constexpr int kResamples = 2000;
  constexpr std::size_t kFewestPlaces = 5;
  if (simulated.size() < kFewestPlaces) return {};
  base::SplitMix64 random(seed);
  std::vector<double> taus;
  std::vector<std::size_t> drawn(simulated.size());
  for (int k = 0; k < kResamples; ++k) {
    for (std::size_t& place : drawn) place = random.below(simulated.size());
    const auto a = mean_scores(simulated, drawn), b = mean_scores(real, drawn);
    if (!a || !b) continue;
    const double tau = metrics::kendall_tau_b(*a, *b);
    if (std::isfinite(tau)) taus.push_back(tau);
  }
  if (taus.empty()) return {};
  std::ranges::sort(taus);
  return {metrics::quantile(taus, 0.025), metrics::quantile(taus, 0.975)};
}

/// Ranks from 1; equal scores share the better rank.
int rank_among(const std::vector<double>& scores, double score) {
  return 1 + static_cast<int>(std::ranges::count_if(scores, [&](double other) { return other > score; }));
}

std::vector<ScoredRun> runs_of(const std::vector<ScoredRun>& runs, bool simulated) {
  std::vector<ScoredRun> result;
  std::ranges::copy_if(runs, std::back_inserter(result),
                       [&](const ScoredRun& run) { return run.is_simulated == simulated; });
  return result;
}

/// Runs over places that have flights of both kinds.
std::vector<ScoredRun> runs_of_compared_places(const std::vector<ScoredRun>& runs) {
  std::set<std::string> with_simulated, with_real;
  for (const ScoredRun& run : runs) (run.is_simulated ? with_simulated : with_real).insert(run.place);
  std::vector<ScoredRun> result;
  std::ranges::copy_if(runs, std::back_inserter(result), [&](const ScoredRun& run) {
    return with_simulated.contains(run.place) && with_real.contains(run.place);
  });
  return result;
}

}  // namespace

std::vector<RankedSystem> rank_systems(const std::vector<ScoredRun>& runs) {
  std::vector<RankedSystem> ranking;
  for (const std::string& system : system_names(runs)) ranking.push_back(rank_one(runs, system));
  std::ranges::stable_sort(ranking, [](const RankedSystem& a, const RankedSystem& b) {
    return a.score.value_or(-1.0) > b.score.value_or(-1.0);
  });
  return ranking;
}

std::optional<RankAgreement> compare_ranks(const std::vector<ScoredRun>& all_runs, std::uint64_t seed) {
  const std::vector<ScoredRun> runs = runs_of_compared_places(all_runs);
  const std::vector<ScoredRun> simulated = runs_of(runs, true), real = runs_of(runs, false);
  std::vector<std::string> names;
  std::vector<double> a, b;
  for (const std::string& system : system_names(runs)) {
    const auto in_simulation = rank_one(simulated, system).score, in_reality = rank_one(real, system).score;
    if (!in_simulation || !in_reality) continue;
    names.push_back(system);
    a.push_back(*in_simulation);
    b.push_back(*in_reality);
  }
  if (names.size() < 2) return std::nullopt;
  const metrics::RankCorrelation correlation = metrics::rank_correlation(a, b, 2000, seed);
  RankAgreement agreement{
      .systems = names.size(), .tau_b = std::nullopt, .method = correlation.interval.method, .ranks = {}};
  if (std::isfinite(correlation.tau_b)) agreement.tau_b = correlation.tau_b;
  for (std::size_t side = 0; side < 2; ++side) {
    if (std::isfinite(correlation.interval.ci95[side])) agreement.interval[side] = correlation.interval.ci95[side];
  }
  std::set<std::string> place_names;
  for (const ScoredRun& run : runs) place_names.insert(run.place);
  const std::vector<std::string> places(place_names.begin(), place_names.end());
  agreement.places = places.size();
  agreement.interval_over_places =
      tau_over_places(place_scores(simulated, names, places), place_scores(real, names, places), seed);
  for (std::size_t i = 0; i < names.size(); ++i) agreement.ranks[names[i]] = {rank_among(a, a[i]), rank_among(b, b[i])};
  return agreement;
}

std::map<std::string, RankAgreement> compare_ranks_by_kind(const std::vector<ScoredRun>& runs, std::uint64_t seed) {
  std::map<std::string, std::vector<ScoredRun>> by_kind;
  for (const ScoredRun& run : runs) {
    if (!run.kind.empty()) by_kind[run.kind].push_back(run);
  }
  std::map<std::string, RankAgreement> result;
  for (const auto& [kind, of_kind] : by_kind) {
    if (auto agreement = compare_ranks(of_kind, seed)) result.emplace(kind, std::move(*agreement));
  }
  return result;
}

json to_json(const std::vector<RankedSystem>& ranking) {
  json list = json::array();
  for (const RankedSystem& ranked : ranking) {
    json interval{nullptr, nullptr};
    if (ranked.interval) interval = *ranked.interval;
    list.push_back({{"system", ranked.system},
                    {"score", ranked.score ? json(*ranked.score) : json(nullptr)},
                    {"interval", interval},
                    {"interval_over", ranked.interval_over},
                    {"flights", ranked.flights},
                    {"places", ranked.places}});
  }
  return list;
}

json to_json(const RankAgreement& agreement) {
  const auto number = [](const std::optional<double>& value) { return value ? json(*value) : json(nullptr); };
  json changed = json::array(), ranks = json::object();
  for (const auto& [system, pair] : agreement.ranks) {
    ranks[system] = {{"simulated", pair[0]}, {"real", pair[1]}};
    if (pair[0] != pair[1]) changed.push_back(system);
  }
  return {
      {"value", number(agreement.tau_b)},
      {"interval", {number(agreement.interval[0]), number(agreement.interval[1])}},
      {"interval_method", agreement.method},
      {"interval_over_places", {number(agreement.interval_over_places[0]), number(agreement.interval_over_places[1])}},
      {"places", agreement.places},
      {"systems", agreement.systems},
      {"ranks", ranks},
      {"rank_changes", changed}};
}

}  // namespace tileflight::study
