#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <utility>
#include <vector>

#include "tileflight/evaluation/metrics/metrics.h"
#include "tileflight/evaluation/metrics/missed_places.h"

namespace tileflight::metrics {

/// A ball on the surface seen by both cameras in which one map has hardly any points and the other has many.
struct MissingPart {
  geometry::Vec3 center;  ///< local frame, metres; on the surface
  double diameter_m = 0;
  std::array<std::size_t, 2> points{};  ///< points of the simulated and of the real map
  std::size_t lacking_map = 0;          ///< the map with hardly any: 0 simulated, 1 real
  double p = 1.0;                       ///< probability of such a ball by chance anywhere in the place (Bonferroni)
};

struct MissingPartsOptions {
  std::vector<double> diameters_m = {1.0, 2.0, 4.0, 8.0};
  double cutoff_m = 1.0;             ///< map points farther from the surface are ignored
  double max_relative_count = 0.1;   ///< largest share of the number expected from the other map
  double significance_level = 0.05;  ///< over all balls together, for listed parts
  double significance_per_ball =
      0.001;                   ///< per ball, for surface counted as lacking; by chance equally frequent in both maps
  std::size_t max_parts = 20;  ///< maximum number of listed parts
};

/// Places where one map lacks surface that the other has. It shows local gaps that shares over the whole place cannot,
/// such as a few metres of one wall.
struct MissingParts {
  MissingPartsOptions options;
  std::size_t balls = 0;  ///< balls tested
  /// Intraclass correlation (0 to 1) of the map that neighbouring points belong to: how much the maps' densities differ
  /// everywhere. The largest over the ball sizes.
  double correlation = std::numeric_limits<double>::quiet_NaN();
  std::vector<MissingPart> parts;  ///< most significant first, without overlaps

  /// Surface samples seen by both cameras (bit-identical points), as indices into both lists.
  std::vector<std::pair<std::uint32_t, std::uint32_t>> shared_samples;
  std::vector<std::uint8_t> informative;  ///< per shared sample: enough points nearby to show that a map lacks it
  std::array<std::vector<std::uint8_t>, 2>
      lacking;  ///< per shared sample: whether the simulated, the real map lacks it

  /// Share of the informative samples that a map lacks. NaN if there are none.
  double lacking_share(std::size_t map) const;
};

/// Finds the parts of the surface that one map lacks. Each map point is assigned to the nearest surface sample, so that
/// point errors do not move it out of a ball. Balls of each size are spaced a quarter of their diameter apart. The
/// simulated map's share of the points in a ball is expected to be the same as overall. The deviation of shares beyond
/// the binomial distribution is estimated from the median ball, which is insensitive to holes, and the counts are
/// reduced accordingly as for clustered samples (n / (1 + (n - 1) correlation), Kish 1965). If the maps' densities
/// differ everywhere, only large gaps are found.
MissingParts missing_parts(const KeptDistances& simulated, const SeenSurface& seen_by_simulated,
                           const KeptDistances& real, const SeenSurface& seen_by_real,
                           const MissingPartsOptions& options = {});

/// Returns {balls, correlation, parts [{center, edge, points {simulated, real}, lacks ("simulated" | "real"), p}]}.
nlohmann::json to_json(const MissingParts& missing);

}  // namespace tileflight::metrics
