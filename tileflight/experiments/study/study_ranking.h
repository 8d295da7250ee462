#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::study {

/// The score of one run, 0 (useless, failed) to 1; nullopt: it has none (not applicable, no map for a map's score).
struct ScoredRun {
  std::string system;
  std::string place;
  std::string flight;  ///< unique over the place: entry of the study, camera and flight
  std::string kind;    ///< of the flight, such as "orbit"; may be empty
  bool is_simulated = false;
  std::optional<double> score;
};

/// A system's mean score with its interval.
struct RankedSystem {
  std::string system;
  std::optional<double> score;  ///< mean over flights of the means over repetitions; nullopt: no score at all
  /// 95 % by Student's t over the places' means, or over repetitions if there is a single place; clipped to 0 and 1;
  /// nullopt: too few values, or all are equal.
  std::optional<std::array<double, 2>> interval;
  std::string interval_over = "none";  ///< "places" or "repetitions"
  std::size_t flights = 0;             ///< with a score
  std::size_t places = 0;
};

/// Ranks systems, best first; systems without a score last, by name. A system's mean covers only the flights on which
/// it has a score; `flights` is their number.
std::vector<RankedSystem> rank_systems(const std::vector<ScoredRun>& runs);

/// Agreement of two rankings, in simulation and on the second flights, of the systems that have a score on both.
struct RankAgreement {
  std::size_t systems = 0;
  std::optional<double> tau_b;
  std::array<std::optional<double>, 2> interval{};
  std::string method = "none";  ///< of the interval (metrics::TauInterval)
  /// Percentile bootstrap over the places, for these systems: what other places would change; unknown below five.
  std::array<std::optional<double>, 2> interval_over_places{};
  std::size_t places = 0;
  std::map<std::string, std::array<int, 2>> ranks;  ///< by system: rank in simulation, on the second flights (from 1)
};

/// Compares the ranking in simulation with that on the second flights. Only places with flights of both kinds count,
/// because another place may have another order. Returns nullopt if fewer than two systems have a score on both.
std::optional<RankAgreement> compare_ranks(const std::vector<ScoredRun>& runs, std::uint64_t seed);

/// Compares the rankings by the flights of each kind alone, by the kind's name; kinds without agreement are left out.
std::map<std::string, RankAgreement> compare_ranks_by_kind(const std::vector<ScoredRun>& runs, std::uint64_t seed);

nlohmann::json to_json(const std::vector<RankedSystem>& ranking);
nlohmann::json to_json(const RankAgreement& agreement);

}  // namespace tileflight::study
