#include "tileflight/experiments/study/study_ranking.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

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
  for (std::size_t i = 0; i < names.size(); ++i) agreement.ranks[names[i]] = {rank_among(a, a[i]), rank_among(b, b[i])};
  return agreement;
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
  return {{"value", number(agreement.tau_b)},
          {"interval", {number(agreement.interval[0]), number(agreement.interval[1])}},
          {"interval_method", agreement.method},
          {"systems", agreement.systems},
          {"ranks", ranks},
          {"rank_changes", changed}};
}

}  // namespace tileflight::study
