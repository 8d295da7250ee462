#include "tileflight/evaluation/metrics/map_entropy.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/geometry/point_order.h"

namespace tileflight::metrics {

using geometry::Mat3;
using geometry::Vec3;

namespace {

constexpr double kUnjudged = std::numeric_limits<double>::quiet_NaN();
/// Smallest over largest eigenvalue below which the volume is due to rounding.
constexpr double kFlat = 1e-12;

std::size_t count(const std::vector<geometry::Place>& places) {
  std::size_t sum = 0;
  for (const auto& place : places) sum += place.count;
  return sum;
}

/// Returns the covariance of the points at these places.
Mat3 covariance(const std::vector<Vec3>& points, const std::vector<geometry::Place>& places) {
  const auto all = static_cast<double>(count(places));
  Vec3 mean = Vec3::Zero();
  for (const auto& place : places) mean += static_cast<double>(place.count) * points[place.index];
  mean /= all;
  Mat3 sum = Mat3::Zero();
  for (const auto& place : places) {
    const Vec3 d = points[place.index] - mean;
    sum += static_cast<double>(place.count) * (d * d.transpose());
  }
  return sum / (all - 1.0);
}

/// Entropy of a covariance; NaN if the points are coplanar.
double entropy_of(const Mat3& S) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(S, Eigen::EigenvaluesOnly);
  const Vec3 spread = solver.eigenvalues();
  if (!(spread[0] > kFlat * spread[2])) return kUnjudged;
  return 0.5 * (3.0 * std::log(2.0 * std::numbers::pi * std::numbers::e) + spread.array().log().sum());
}

void check(const geometry::PointCloud& map, const MapEntropyOptions& options) {
  if (!(options.radius_m > 0.0) || !std::isfinite(options.radius_m))
    throw InputError("radius of the map's entropy", "must be above zero, in metres");
  if (map.empty()) throw InputError("map", "has no points; there is nothing to score");
  for (const Vec3& p : map.positions) {
    if (!p.allFinite()) throw InputError("map", "a point is not finite");
  }
}

/// Indices of the sampled points: as many as the limit on the total number of neighbours allows, estimated from a few
/// probes.
std::vector<std::uint32_t> sample_points(const std::vector<Vec3>& points, const geometry::NearestIndex& index,
                                         const MapEntropyOptions& options) {
  const std::vector<std::uint32_t> asked = geometry::sample_evenly(points, options.max_points);
  const std::vector<std::uint32_t> probes = evenly_of(asked, kEntropyProbes);
  double neighbors = 0.0;
  for (const std::uint32_t i : probes)
    neighbors += static_cast<double>(count(index.places_within(points[i], options.radius_m)));
  const std::size_t most = entropy_samples(neighbors, probes.size(), options);
  return asked.size() == points.size() ? geometry::sample_evenly(points, most) : evenly_of(asked, most);
}

/// Sets mean and standard error from the evaluated entropies.
void add_mean(const std::vector<double>& entropies, MapEntropy& result) {
  double sum = 0.0, squares = 0.0;
  for (const double h : entropies) {
    if (std::isnan(h)) continue;
    sum += h;
    ++result.evaluated;
  }
  if (result.evaluated == 0) return;
  const auto n = static_cast<double>(result.evaluated);
  result.mean = sum / n;
  if (result.sampled == result.points) {
    result.standard_error = 0.0;
    return;
  }
  for (const double h : entropies) {
    if (!std::isnan(h)) squares += (h - result.mean) * (h - result.mean);
  }
  if (result.evaluated > 1) result.standard_error = std::sqrt(squares / (n - 1.0) / n);
}

}  // namespace

double local_entropy(const std::vector<Vec3>& points, const geometry::NearestIndex& index, const Vec3& at,
                     const MapEntropyOptions& options) {
  const auto places = index.places_within(at, options.radius_m);
  const bool enough = count(places) >= std::max<std::size_t>(4, options.min_neighbors);
  return enough ? entropy_of(covariance(points, places)) : kUnjudged;
}

std::size_t entropy_samples(double neighbors, std::size_t probes, const MapEntropyOptions& options) {
  constexpr std::size_t kLeast = 1000;
  const double each = neighbors / static_cast<double>(probes);  // each point is at least its own neighbour
  return std::max(kLeast, static_cast<std::size_t>(options.max_total_neighbors / each));
}

MapEntropy mean_entropy(const std::vector<double>& entropies, std::size_t points, double radius_m) {
  MapEntropy result{.radius_m = radius_m, .points = points, .sampled = entropies.size()};
  add_mean(entropies, result);
  return result;
}

MapEntropy map_entropy(const geometry::PointCloud& map, const geometry::NearestIndex& index,
                       const MapEntropyOptions& options) {
  check(map, options);
  const std::vector<std::uint32_t> asked = sample_points(map.positions, index, options);
  std::vector<double> entropies(asked.size(), kUnjudged);
  tbb::parallel_for(std::size_t{0}, asked.size(), [&](std::size_t k) {
    entropies[k] = local_entropy(map.positions, index, map.positions[asked[k]], options);
  });
  return mean_entropy(entropies, map.size(), options.radius_m);
}

MapEntropy map_entropy(const geometry::PointCloud& map, const MapEntropyOptions& options) {
  check(map, options);
  return map_entropy(map, geometry::NearestIndex(map.positions), options);
}

MapEntropy read_map_entropy(base::StrictSection reader) {
  MapEntropy e;
  e.radius_m = reader.required_number("radius");
  e.points = reader.required_count("points");
  e.sampled = reader.has("asked") ? reader.required_count("asked") : e.points;  // older files used all points
  e.evaluated = reader.required_count("judged");
  reader.required_number("share_judged");  // follows from the counts
  e.mean = reader.required_number("mean");
  if (reader.has("standard_error")) e.standard_error = reader.required_number("standard_error");
  reader.require_all_keys_used();
  return e;
}

nlohmann::json to_json(const MapEntropy& e) {
  const double share = e.sampled > 0 ? static_cast<double>(e.evaluated) / static_cast<double>(e.sampled) : 0.0;
  return {{"radius", e.radius_m},
          {"points", e.points},
          {"asked", e.sampled},
          {"judged", e.evaluated},
          {"share_judged", share},
          {"mean", e.mean},
          {"standard_error", e.standard_error}};
}

}  // namespace tileflight::metrics
