#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/evaluation/metrics/map_entropy.h"

// The steps of map_entropy(), for maps that are not held in memory as a whole.

namespace tileflight::metrics {

/// Entropy around a point of the map: h of map_entropy(). `index`: of `points`. NaN if fewer than `min_neighbors`, or
/// coplanar points, lie within the radius.
double local_entropy(const std::vector<geometry::Vec3>& points, const geometry::NearestIndex& index,
                     const geometry::Vec3& at, const MapEntropyOptions& options);

/// How many of the evenly chosen points are asked for the number of neighbours of all: neighbours of few.
inline constexpr std::size_t kEntropyProbes = 256;

/// Points to evaluate if `probes` points have `neighbors` neighbours together.
std::size_t entropy_samples(double neighbors, std::size_t probes, const MapEntropyOptions& options);

/// `count` evenly spaced elements of a list; all if it has no more.
template <typename T>
std::vector<T> evenly_of(const std::vector<T>& list, std::size_t count) {
  if (count >= list.size()) return list;
  std::vector<T> result;
  for (std::size_t k = 0; k < count; ++k) result.push_back(list[k * list.size() / count]);
  return result;
}

/// The mean of what was evaluated at some of a map's `points` points, in order.
MapEntropy mean_entropy(const std::vector<double>& entropies, std::size_t points, double radius_m);

}  // namespace tileflight::metrics
