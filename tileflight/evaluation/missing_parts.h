#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/missed_places.h"

namespace tileflight::evaluation {

/// A ball around the surface that both cameras saw, where one map has hardly a point and the other has many.
struct MissingPart {
  geometry::Vec3 center;                ///< local frame, metres; on the surface
  double edge_m = 0;                    ///< across
  std::array<std::size_t, 2> points{};  ///< of the simulated, of the real map
  std::size_t lacks = 0;                ///< the map that has hardly any: 0 simulated, 1 real
  double p = 1.0;                       ///< by chance anywhere in the place (Bonferroni)
};

struct MissingPartsOptions {
  std::vector<double> edges_m = {1.0, 2.0, 4.0, 8.0};
  double cutoff_m = 1.0;        ///< map points farther from the surface are no part of it
  double hardly = 0.1;          ///< of the points that the other map lets expect
  double level = 0.05;          ///< of all balls together: parts that are listed
  double level_of_one = 0.001;  ///< of one ball: surface that counts as lacking; equally often in both by chance
  std::size_t most = 20;        ///< parts that are listed
};

/// Where one map lacks what the other has, one place at a time: what shares over the whole place cannot show, such as a
/// few metres of one wall.
struct MissingParts {
  MissingPartsOptions options;
  std::size_t balls = 0;  ///< that were looked at
  /// Of the choice of neighbouring points between the two maps (intraclass, 0 to 1): how far the maps' densities differ
  /// everywhere. The largest over the sizes of balls.
  double correlation = std::numeric_limits<double>::quiet_NaN();
  std::vector<MissingPart> parts;  ///< the surest first; none overlaps one before it

  /// Samples of the surface that both cameras saw (the same point to the bit), by their numbers in both lists.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> common;
  std::vector<std::uint8_t> telling;               ///< of each: near enough points to show that a map lacks it
  std::array<std::vector<std::uint8_t>, 2> lacks;  ///< of those that tell: whether the simulated, the real map lacks it

  /// Of the surface where the maps tell, what a map lacks. NaN where they tell nothing.
  double lacking_share(std::size_t map) const;
};

/// Each map point counts at the nearest sample of the surface, so that errors of the points do not move them out of a
/// ball. Balls of each size lie a quarter of their width apart. Of a ball's points a share is the simulated map's as
/// large as over all; how far shares deviate beyond the binomial distribution is estimated from the median ball, which
/// holes do not move, and taken off the counts as of clusters of alike points (n / (1 + (n - 1) correlation), Kish
/// 1965). Maps of different kinds deviate everywhere, and then only what is grossly missing is found.
MissingParts missing_parts(const KeptDistances& simulated, const SeenSurface& seen_by_simulated,
                           const KeptDistances& real, const SeenSurface& seen_by_real,
                           const MissingPartsOptions& options = {});

/// {balls, correlation, parts [{center, edge, points {simulated, real}, lacks ("simulated" | "real"), p}]}.
nlohmann::json to_json(const MissingParts& missing);

}  // namespace tileflight::evaluation
