#include "tileflight/experiments/study/system_comparison.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numeric>
#include <set>
#include <span>
#include <utility>

#include "tileflight/core/base/random_numbers.h"
#include "tileflight/evaluation/metrics/block_bootstrap.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::study {
namespace {

using nlohmann::json;

constexpr double kLevel = 0.05;

/// The differences of two systems over one place.
struct PlaceSum {
  double sum = 0.0;    ///< of the differences
  double count = 0.0;  ///< of flights
};

/// The mean difference over flights with its standard error, of which places are the samples.
struct MeanDifference {
  double mean = 0.0, sigma = 0.0;
};

MeanDifference mean_difference(std::span<const PlaceSum> places) {
  PlaceSum all;
  for (const PlaceSum& place : places) all.sum += place.sum, all.count += place.count;
  const double mean = all.sum / all.count;
  double squares = 0.0;
  for (const PlaceSum& place : places) squares += std::pow(place.sum - mean * place.count, 2);
  const auto n = static_cast<double>(places.size());
  return {mean, n > 1.0 ? std::sqrt(n / (n - 1.0) * squares) / all.count : 0.0};
}

/// Mean scores over repetitions, by place and flight.
using FlightScores = std::map<std::pair<std::string, std::string>, double>;

std::map<std::string, FlightScores> scores_by_system(const std::vector<ScoredRun>& runs) {
  std::map<std::string, std::map<std::pair<std::string, std::string>, std::vector<double>>> all;
  for (const ScoredRun& run : runs) {
    if (run.score) all[run.system][{run.place, run.flight}].push_back(*run.score);
  }
  std::map<std::string, FlightScores> means;
  for (const auto& [system, flights] : all) {
    for (const auto& [flight, scores] : flights)
      means[system][flight] = std::accumulate(scores.begin(), scores.end(), 0.0) / static_cast<double>(scores.size());
  }
  return means;
}

std::vector<PlaceSum> place_sums(const FlightScores& a, const FlightScores& b) {
  std::map<std::string, PlaceSum> places;
  for (const auto& [flight, score] : a) {
    const auto other = b.find(flight);
    if (other == b.end()) continue;
    PlaceSum& place = places[flight.first];
    place.sum += score - other->second;
    place.count += 1.0;
  }
  std::vector<PlaceSum> sums;
  for (const auto& [name, place] : places) sums.push_back(place);
  return sums;
}

std::optional<std::array<double, 2>> bootstrap_interval(const std::vector<PlaceSum>& places, std::uint64_t seed) {
  constexpr int kResamples = 4000;
  if (places.size() < SystemDifference::kFewestPlaces) return std::nullopt;
  const MeanDifference found = mean_difference(places);
  if (!(found.sigma > 0.0)) return std::nullopt;
  base::SplitMix64 random(seed);
  std::vector<double> deviations;
  std::vector<PlaceSum> drawn(places.size());
  for (int k = 0; k < kResamples; ++k) {
    for (PlaceSum& place : drawn) place = places[random.below(places.size())];
    const MeanDifference again = mean_difference(drawn);
    // A draw of equal places, which has no error of its own, is rare from five places on.
    if (again.sigma > 1e-3 * found.sigma) deviations.push_back((again.mean - found.mean) / again.sigma);
  }
  std::ranges::sort(deviations);
  const auto end = [&](double share) {
    return std::clamp(found.mean - metrics::quantile(deviations, share) * found.sigma, -1.0, 1.0);
  };
  return std::array<double, 2>{end(0.975), end(0.025)};
}

double sign_flip_p(const std::vector<PlaceSum>& places, std::uint64_t seed) {
  constexpr std::size_t kEnumerated = 16, kDrawn = 20'000;
  const auto sum_with = [&](auto is_flipped) {
    double sum = 0.0;
    for (std::size_t i = 0; i < places.size(); ++i) sum += is_flipped(i) ? -places[i].sum : places[i].sum;
    return std::abs(sum);
  };
  double scale = 0.0;
  for (const PlaceSum& place : places) scale += std::abs(place.sum);
  const double least = sum_with([](std::size_t) { return false; }) - 1e-12 * scale;  // equal sums differ by rounding
  std::size_t as_large = 0, all = 0;
  if (places.size() <= kEnumerated) {
    for (; all < std::size_t{1} << places.size(); ++all)
      as_large += sum_with([&](std::size_t i) { return ((all >> i) & 1U) != 0; }) >= least;
  } else {
    base::SplitMix64 random(seed);
    as_large = all = 1;  // the signs as they are (Phipson and Smyth 2010)
    for (; all <= kDrawn; ++all)
      as_large += sum_with([&](std::size_t) { return (random.next() >> 63U) != 0; }) >= least;
  }
  return static_cast<double>(as_large) / static_cast<double>(all);
}

std::optional<std::size_t> places_needed(const std::vector<PlaceSum>& places, std::size_t pairs) {
  constexpr double kPower = 0.8;
  constexpr std::size_t kMost = 1000;
  const MeanDifference found = mean_difference(places);
  if (places.size() < 2 || !(found.sigma > 0.0) || found.mean == 0.0) return std::nullopt;
  const double sigma_of_one = found.sigma * std::sqrt(static_cast<double>(places.size()));
  const double level = kLevel / static_cast<double>(pairs);
  for (std::size_t n = fewest_places_to_show(pairs); n <= kMost; ++n) {
    const auto freedom = static_cast<double>(n - 1);
    const double t =
        metrics::student_t_quantile(1.0 - 0.5 * level, freedom) + metrics::student_t_quantile(kPower, freedom);
    if (t * sigma_of_one <= std::abs(found.mean) * std::sqrt(static_cast<double>(n))) return n;
  }
  return std::nullopt;
}

/// Holm's step-down: the k-th smallest p counts (pairs - k) times, and none less than those before.
void adjust(std::vector<SystemDifference>& differences) {
  std::vector<SystemDifference*> by_p;
  for (SystemDifference& one : differences) by_p.push_back(&one);
  std::ranges::stable_sort(by_p, {}, [](const SystemDifference* one) { return one->p; });
  double largest = 0.0;
  for (std::size_t k = 0; k < by_p.size(); ++k) {
    largest = std::max(largest, std::min(1.0, static_cast<double>(by_p.size() - k) * by_p[k]->p));
    by_p[k]->adjusted_p = largest;
  }
}

}  // namespace

std::size_t fewest_places_to_show(std::size_t pairs) {
  std::size_t places = 1;
  while (std::ldexp(1.0, 1 - static_cast<int>(places)) * static_cast<double>(pairs) >= kLevel) ++places;
  return places;
}

std::vector<SystemDifference> compare_systems(const std::vector<ScoredRun>& runs, std::uint64_t seed) {
  const std::map<std::string, FlightScores> scores = scores_by_system(runs);
  std::vector<SystemDifference> differences;
  std::vector<std::vector<PlaceSum>> samples;
  for (auto first = scores.begin(); first != scores.end(); ++first) {
    for (auto second = std::next(first); second != scores.end(); ++second) {
      std::vector<PlaceSum> places = place_sums(first->second, second->second);
      if (places.empty()) continue;
      SystemDifference one{.better = first->first, .worse = second->first, .difference = mean_difference(places).mean};
      if (one.difference < 0.0) {
        std::swap(one.better, one.worse);
        one.difference = -one.difference;
        for (PlaceSum& place : places) place.sum = -place.sum;
      }
      one.places = places.size();
      for (const PlaceSum& place : places) one.flights += static_cast<std::size_t>(place.count);
      const std::uint64_t key = base::stream_key(seed, differences.size());
      one.interval = bootstrap_interval(places, key);
      one.p = sign_flip_p(places, key);
      differences.push_back(std::move(one));
      samples.push_back(std::move(places));
    }
  }
  for (std::size_t i = 0; i < differences.size(); ++i)
    differences[i].places_needed = places_needed(samples[i], differences.size());
  adjust(differences);
  std::ranges::stable_sort(differences, [](const auto& a, const auto& b) { return a.difference > b.difference; });
  return differences;
}

json to_json(const std::vector<SystemDifference>& differences) {
  json list = json::array();
  for (const SystemDifference& one : differences) {
    list.push_back({{"better", one.better},
                    {"worse", one.worse},
                    {"difference", one.difference},
                    {"interval", one.interval ? json(*one.interval) : json{nullptr, nullptr}},
                    {"p", one.p},
                    {"adjusted_p", one.adjusted_p},
                    {"real", one.is_real()},
                    {"flights", one.flights},
                    {"places", one.places},
                    {"places_needed", one.places_needed ? json(*one.places_needed) : json(nullptr)}});
  }
  return list;
}

}  // namespace tileflight::study
