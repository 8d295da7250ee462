#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/evaluation/metrics.h"
#include "tileflight/evaluation/missed_places.h"

namespace tileflight::evaluation {

/// A cube of space that both cameras saw, where one map has hardly a point and the other has many.
struct MissingPart {
  geometry::Vec3 center;  ///< local frame, metres
  double edge_m = 0;
  std::array<std::size_t, 2> points{};  ///< of the simulated, of the real map
  std::size_t lacks = 0;                ///< the map that has hardly any: 0 simulated, 1 real
  double p = 1.0;                       ///< by chance anywhere in the place (Bonferroni)
};

struct MissingPartsOptions {
  std::vector<double> edges_m = {2.0, 4.0, 8.0};
  double cutoff_m = 1.0;  ///< map points farther from the surface are no part of it
  double hardly = 0.1;    ///< of the points that the other map lets expect
  double level = 0.05;    ///< of all cubes together
  std::size_t most = 20;  ///< parts that are listed
};

/// Where one map lacks what the other has, one place at a time: what shares over the whole place cannot show, such as a
/// few metres of one wall.
struct MissingParts {
  MissingPartsOptions options;
  std::size_t cubes = 0;  ///< that were looked at
  /// Of the counts beyond that of independent points, at least 1: what maps of these two kinds differ by everywhere.
  double dispersion = std::numeric_limits<double>::quiet_NaN();
  std::vector<MissingPart> parts;  ///< the surest first; none overlaps one before it
};

/// Cubes of each edge on lattices a half edge apart. Of a cube's points a share is the simulated map's as large as over
/// all; how far shares deviate beyond the binomial distribution, estimated over all cubes with ten points or more, is
/// taken off the counts (quasi-binomial: McCullagh and Nelder, Generalized Linear Models, 1989, 4.5). Maps of different
/// kinds deviate everywhere, and then only what is grossly missing is listed.
MissingParts missing_parts(const KeptDistances& simulated, const SeenSurface& seen_by_simulated,
                           const KeptDistances& real, const SeenSurface& seen_by_real,
                           const MissingPartsOptions& options = {});

/// {cubes, dispersion, parts [{center, edge, points {simulated, real}, lacks ("simulated" | "real"), p}]}.
nlohmann::json to_json(const MissingParts& missing);

}  // namespace tileflight::evaluation
