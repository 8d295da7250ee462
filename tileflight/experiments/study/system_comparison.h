#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/experiments/study/study_ranking.h"

namespace tileflight::study {

/// Two systems' scores on the same flights: the mean difference, and whether it is more than chance. Flights over one
/// place resemble each other, so that places, not flights, are the independent samples.
struct SystemDifference {
  std::string better, worse;  ///< `better` has the higher mean, or the name that comes first
  double difference = 0.0;    ///< mean over flights of the score of `better` less that of `worse`
  std::size_t flights = 0;    ///< on which both have a score
  std::size_t places = 0;
  /// 95 % of this difference alone: studentised bootstrap over places (Efron and Tibshirani 1993, section 12.5), within
  /// -1 and 1; nullopt: fewer than kFewestPlaces, or the same difference at all places.
  std::optional<std::array<double, 2>> interval;
  /// Probability of a difference as large, of either sign, if both systems were as good: the signs of the places'
  /// differences are drawn anew, all of them up to 2^16, else 20 000.
  double p = 1.0;
  double adjusted_p = 1.0;  ///< after Holm (1979), for all pairs that are compared
  /// Number of such places that would show a difference of this size among as many pairs, with a power of 80 %;
  /// nullopt: the places tell nothing of it, or over a thousand.
  std::optional<std::size_t> places_needed;

  static constexpr std::size_t kFewestPlaces = 5;

  bool is_real() const { return adjusted_p < 0.05; }
};

/// Compares all pairs of systems that have a score on a common flight, by flights of equal weight, each the mean of its
/// repetitions. The largest differences come first. Deterministic.
std::vector<SystemDifference> compare_systems(const std::vector<ScoredRun>& runs, std::uint64_t seed);

/// Returns the least number of places from which on the signs of their differences can show anything among so many
/// pairs: 2^(1 - places) must be below 0.05 / pairs.
std::size_t fewest_places_to_show(std::size_t pairs);

/// Returns a list of {better, worse, difference, interval, p, adjusted_p, real, flights, places, places_needed}.
nlohmann::json to_json(const std::vector<SystemDifference>& differences);

}  // namespace tileflight::study
