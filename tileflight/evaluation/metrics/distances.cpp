#include "tileflight/evaluation/metrics/distances.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/evaluation/metrics/part_search.h"

namespace tileflight::metrics {

using geometry::PointCloud;
using geometry::Vec3;

namespace {

/// Share of the distances up to each of the increasing thresholds. Empty without distances.
std::vector<double> shares_within(const std::vector<double>& thresholds_m, const std::vector<double>& distances) {
  if (distances.empty()) return {};
  std::vector<std::size_t> first_within(thresholds_m.size() + 1, 0);  // number of distances with this as their
                                                                      // smallest threshold
  for (const double d : distances) {
    const auto least = std::lower_bound(thresholds_m.begin(), thresholds_m.end(), d);
    ++first_within[static_cast<std::size_t>(least - thresholds_m.begin())];
  }
  std::vector<double> shares;
  std::size_t within = 0;
  for (std::size_t k = 0; k < thresholds_m.size(); ++k) {
    within += first_within[k];
    shares.push_back(static_cast<double>(within) / static_cast<double>(distances.size()));
  }
  return shares;
}

double harmonic_mean(double a, double b) { return a + b > 0.0 ? 2.0 * a * b / (a + b) : 0.0; }

std::vector<double> truncate_at(const std::vector<double>& distances, double cutoff_m) {
  std::vector<double> kept;
  std::copy_if(distances.begin(), distances.end(), std::back_inserter(kept), [&](double d) { return d <= cutoff_m; });
  return kept;
}

/// Histogram from 0 to the cut-off; the cut-off itself belongs to the last bin.
Histogram histogram_of(const std::vector<double>& kept, double cutoff_m, int bins) {
  Histogram histogram;
  for (int k = 0; k <= bins; ++k) histogram.edges.push_back(cutoff_m * k / bins);
  histogram.counts.assign(static_cast<std::size_t>(bins), 0);
  for (const double d : kept) {
    const int bin = std::min(bins - 1, static_cast<int>(d / cutoff_m * bins));
    ++histogram.counts[static_cast<std::size_t>(bin)];
  }
  return histogram;
}

}  // namespace

void require_scorable(const PointCloud& cloud, const char* name) {
  if (cloud.empty()) throw InputError(name, "has no points; there is nothing to score");
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!cloud.positions[i].allFinite()) throw InputError(name, "point " + std::to_string(i) + " is not finite");
  }
}

double share_within(const std::vector<double>& distances, double threshold_m) {
  if (distances.empty()) return std::numeric_limits<double>::quiet_NaN();
  const auto within = std::count_if(distances.begin(), distances.end(), [&](double d) { return d <= threshold_m; });
  return static_cast<double>(within) / static_cast<double>(distances.size());
}

DistanceStatistics compute_statistics(std::vector<double> distances) {
  DistanceStatistics result;
  result.count = distances.size();
  if (distances.empty()) return result;
  const auto n = static_cast<double>(distances.size());
  double sum = 0.0, squares = 0.0, deviations = 0.0;
  for (const double d : distances) {
    sum += d;
    squares += d * d;
  }
  result.mean = sum / n;
  result.rmse = std::sqrt(squares / n);
  for (const double d : distances) deviations += (d - result.mean) * (d - result.mean);
  if (distances.size() > 1) result.std = std::sqrt(deviations / (n - 1.0));
  result.median = base::median(distances);
  return result;
}

Percentiles compute_percentiles(std::vector<double> distances) {
  Percentiles result;
  if (distances.empty()) return result;
  auto first = distances.begin();  // elements before it are already in order
  for (const int percent : {25, 50, 75, 90, 95, 99}) {
    const std::size_t hundredths = (distances.size() - 1) * static_cast<std::size_t>(percent);
    const auto below = distances.begin() + static_cast<std::ptrdiff_t>(hundredths / 100);
    std::nth_element(first, below, distances.end());
    const double fraction = static_cast<double>(hundredths % 100) / 100.0;
    result[percent] =
        fraction > 0.0 ? (1.0 - fraction) * *below + fraction * *std::min_element(below + 1, distances.end()) : *below;
    first = below;
  }
  return result;
}

CumulativeCurve cumulative_curve(const std::vector<double>& distances, const std::vector<double>& sample_distances) {
  constexpr int kPerDecade = 20, kDecades = 3;
  CumulativeCurve curve;
  for (int k = 0; k <= kPerDecade * kDecades; ++k)
    curve.thresholds_m.push_back(0.01 * std::pow(10.0, static_cast<double>(k) / kPerDecade));
  curve.shares = shares_within(curve.thresholds_m, distances);
  if (curve.shares.empty() || sample_distances.empty()) return curve;
  curve.completeness = shares_within(curve.thresholds_m, sample_distances);
  for (std::size_t k = 0; k < curve.shares.size(); ++k)
    curve.f_score.push_back(harmonic_mean(curve.shares[k], curve.completeness[k]));
  return curve;
}

double area_under_curve(const std::vector<double>& thresholds_m, const std::vector<double>& shares) {
  if (shares.size() < 2 || shares.size() != thresholds_m.size()) return std::numeric_limits<double>::quiet_NaN();
  double area = 0.0;
  for (std::size_t k = 1; k < shares.size(); ++k)
    area += 0.5 * (shares[k - 1] + shares[k]) * std::log(thresholds_m[k] / thresholds_m[k - 1]);
  return area / std::log(thresholds_m.back() / thresholds_m.front());
}

std::vector<double> cloud_distances(const PointCloud& points, const PointCloud& targets, const char* what,
                                    const char* target_name, double radius_m) {
  require_scorable(targets, target_name);
  return cloud_distances(points, geometry::NearestIndex(targets.positions), what, radius_m);
}

std::vector<double> cloud_distances(const PointCloud& points, const geometry::NearestIndex& targets, const char* what,
                                    double radius_m) {
  require_scorable(points, what);
  return nearest_distances(points.positions, radius_m, [&](const Vec3& p, double within_m) -> std::optional<double> {
    const auto nearest = targets.nearest(p, within_m);
    return nearest ? std::optional(nearest->distance_m) : std::nullopt;
  });
}

std::vector<double> surface_distances(const PointCloud& points, const geometry::TriangleIndex& surface) {
  require_scorable(points, "map");
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  return nearest_distances(points.positions, kAnywhere, [&](const Vec3& p, double within_m) -> std::optional<double> {
    const auto nearest = surface.nearest(p, within_m);
    return nearest ? std::optional(nearest->distance_m) : std::nullopt;
  });
}

KeptDistances keep_within_cutoff(const std::vector<Vec3>& positions, const std::vector<double>& distances,
                                 double cutoff_m) {
  KeptDistances kept;
  kept.points = distances.size();
  for (std::size_t i = 0; i < distances.size(); ++i) {
    if (!(distances[i] <= cutoff_m)) continue;
    kept.positions.push_back(positions[i]);
    kept.distances.push_back(distances[i]);
  }
  return kept;
}

DistanceStatistics compute_quantization_floor(const std::vector<double>& distances, double cutoff_m) {
  return compute_statistics(truncate_at(distances, cutoff_m));
}

MapMetrics score_map(const std::vector<double>& distances, const DistanceStatistics& floor,
                     const MapMetricsOptions& options) {
  if (!(options.cutoff_m > 0.0) || !std::isfinite(options.cutoff_m))
    throw InputError("cut-off", "must be above zero, in metres");
  if (options.bins < 1) throw InputError("bins", "must be at least 1");
  const std::vector<double> kept = truncate_at(distances, options.cutoff_m);
  MapMetrics result;
  result.points = distances.size();
  result.correspondences = kept.size();
  result.distances = compute_statistics(kept);
  result.percentiles = compute_percentiles(kept);
  result.histogram = histogram_of(kept, options.cutoff_m, options.bins);
  result.cutoff_m = options.cutoff_m;
  result.quantization_floor = floor;
  return result;
}

SurfaceMetrics score_surface(const std::vector<double>& distances, const std::vector<double>& sample_distances,
                             const std::vector<double>& thresholds_m) {
  SurfaceMetrics result;
  result.distances = compute_statistics(distances);
  result.percentiles = compute_percentiles(distances);
  result.cumulative = cumulative_curve(distances, sample_distances);
  for (const double t : thresholds_m) {
    if (!(t > 0.0) || !std::isfinite(t)) throw InputError("threshold", "must be above zero, in metres");
    const double accuracy = share_within(distances, t);
    result.accuracy[t] = accuracy;
    if (sample_distances.empty()) continue;
    const double completeness = share_within(sample_distances, t);
    result.completeness[t] = completeness;
    result.f_score[t] = harmonic_mean(accuracy, completeness);
  }
  return result;
}

}  // namespace tileflight::metrics
