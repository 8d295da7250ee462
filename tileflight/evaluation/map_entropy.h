#pragma once

#include <cstddef>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/geometry/nearest.h"
#include "tileflight/geometry/point_cloud.h"

namespace tileflight::evaluation {

/// How sharp a map is, judged without any truth: mean map entropy. Lower is sharper. Comparable only between maps of
/// one scale and one radius; outliers that are alone have no neighbours and are not judged, so the share belongs to it.
struct MapEntropy {
  double radius_m = 0;
  std::size_t points = 0;                                  ///< of the map
  std::size_t asked = 0;                                   ///< of them: all, or an even choice of a large map's
  std::size_t judged = 0;                                  ///< of those asked, with enough neighbours, not in one plane
  double mean = std::numeric_limits<double>::quiet_NaN();  ///< natural logarithm of metres cubed
  /// Of the mean, from not having asked all points; 0 where all were asked.
  double standard_error = std::numeric_limits<double>::quiet_NaN();
};

struct MapEntropyOptions {
  double radius_m = 2.0;
  std::size_t least_neighbors = 5;    ///< within the radius, the point itself included
  std::size_t most_points = 200'000;  ///< that are asked; their neighbours are all of the map's points
  double most_neighbors = 1e8;        ///< of all points that are asked together, about; fewer are asked of a dense map
};

/// Mean over the points of h = 1/2 ln |2 pi e S|, the entropy of a normal distribution with the covariance S of the
/// points within the radius (divisor n - 1): Razlaw, Droeschel, Holz and Behnke, "Evaluation of registration methods
/// for sparse 3D laser scans", ECMR 2015, (1) and (2). Of a large map evenly chosen points are asked
/// (geometry::evenly_chosen): the mean estimates that over all points, and says with which standard error. Throws
/// InputError: empty, not finite, a radius that is not above zero.
MapEntropy map_entropy(const geometry::PointCloud& aligned_map, const MapEntropyOptions& options = {});

/// The same with an index of the map's positions that is there already.
MapEntropy map_entropy(const geometry::PointCloud& aligned_map, const geometry::NearestIndex& index,
                       const MapEntropyOptions& options = {});

/// {radius, points, asked, judged, share_judged (of those asked), mean, standard_error}.
nlohmann::json to_json(const MapEntropy& entropy);

/// The inverse; throws InputError (`where`, key, cause).
MapEntropy map_entropy_from_json(const nlohmann::json& json, const std::string& where);

}  // namespace tileflight::evaluation
