#pragma once

namespace tileflight::base {
class StrictSection;
}

// The steps of map_entropy(), for maps that are not held in memory as a whole.

#include <cstddef>
#include <cstdint>
#include <limits>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/point_cloud.h"

namespace tileflight::metrics {

/// Sharpness of a map without ground truth: mean map entropy; lower is sharper. Comparable only between maps of the
/// same scale with the same radius. Isolated outliers have no neighbours and are not evaluated, so the share evaluated
/// must be considered with it.
struct MapEntropy {
  double radius_m = 0;
  std::size_t points = 0;                                  ///< of the map
  std::size_t sampled = 0;                                 ///< of them: all, or an even subsample of a large map
  std::size_t evaluated = 0;                               ///< of the sampled ones: with enough neighbours that are not
                                                           ///< coplanar
  double mean = std::numeric_limits<double>::quiet_NaN();  ///< mean entropy, natural logarithm of cubic metres
  /// Standard error of the mean due to subsampling; 0 if all points were used.
  double standard_error = std::numeric_limits<double>::quiet_NaN();
};

struct MapEntropyOptions {
  double radius_m = 2.0;
  std::size_t min_neighbors = 5;     ///< within the radius, the point itself included
  std::size_t max_points = 200'000;  ///< maximum points evaluated; neighbours come from all points of the map
  double max_total_neighbors = 1e8;  ///< approximate limit on the total number of neighbours; a dense map is sampled
                                     ///< less
};

/// Computes the mean over the points of h = 1/2 ln |2 pi e S|, the entropy of a normal distribution with the covariance
/// S of the points within the radius (divisor n - 1): Razlaw, Droeschel, Holz and Behnke, "Evaluation of registration
/// methods for sparse 3D laser scans", ECMR 2015, (1) and (2). Large maps are subsampled evenly
/// (geometry::sample_evenly), and the standard error of the mean is given. Throws InputError for an empty or non-finite
/// map and for a radius that is not positive.
MapEntropy map_entropy(const geometry::PointCloud& aligned_map, const MapEntropyOptions& options = {});

/// Computes the entropy with an existing index of the map's positions.
MapEntropy map_entropy(const geometry::PointCloud& aligned_map, const geometry::NearestIndex& index,
                       const MapEntropyOptions& options = {});

/// Returns {radius, points, asked, judged, share_judged (of those asked), mean, standard_error}.
nlohmann::json to_json(const MapEntropy& entropy);

/// Reads the object that to_json() returns. Throws InputError as StrictSection does.
MapEntropy read_map_entropy(base::StrictSection section);

/// Returns the entropy h around a point of the map. `index`: of `points`. NaN if fewer than `min_neighbors`, or
/// coplanar points, lie within the radius.
double local_entropy(const std::vector<geometry::Vec3>& points, const geometry::NearestIndex& index,
                     const geometry::Vec3& at, const MapEntropyOptions& options);

/// Number of evenly chosen points whose neighbours are counted, to estimate the number of neighbours of all points.
inline constexpr std::size_t kEntropyProbes = 256;

/// Returns the number of points to evaluate if `probes` points have `neighbors` neighbours together.
std::size_t entropy_samples(double neighbors, std::size_t probes, const MapEntropyOptions& options);

/// Returns `count` evenly spaced elements of a list; all if it has no more.
template <typename T>
std::vector<T> evenly_of(const std::vector<T>& list, std::size_t count) {
  if (count >= list.size()) return list;
  std::vector<T> result;
  for (std::size_t k = 0; k < count; ++k) result.push_back(list[k * list.size() / count]);
  return result;
}

/// Returns the mean of the entropies that were computed at some of a map's `points` points, in order.
MapEntropy mean_entropy(const std::vector<double>& entropies, std::size_t points, double radius_m);

}  // namespace tileflight::metrics
