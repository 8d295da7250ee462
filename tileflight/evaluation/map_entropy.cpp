#include "tileflight/evaluation/map_entropy.h"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <vector>

#include "tileflight/evaluation/json_reader.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/nearest.h"

namespace tileflight::evaluation {

using geometry::Mat3;
using geometry::Vec3;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
/// Least eigenvalue over the largest below which rounding, not spread, makes the volume.
constexpr double kFlat = 1e-12;

Mat3 covariance(const std::vector<Vec3>& points, const std::vector<geometry::Neighbor>& of) {
  Vec3 mean = Vec3::Zero();
  for (const auto& neighbor : of) mean += points[neighbor.index];
  mean /= static_cast<double>(of.size());
  Mat3 sum = Mat3::Zero();
  for (const auto& neighbor : of) {
    const Vec3 d = points[neighbor.index] - mean;
    sum += d * d.transpose();
  }
  return sum / static_cast<double>(of.size() - 1);
}

/// NaN where the points lie in a plane.
double entropy_of(const Mat3& S) {
  const Eigen::SelfAdjointEigenSolver<Mat3> solver(S, Eigen::EigenvaluesOnly);
  const Vec3 spread = solver.eigenvalues();
  if (!(spread[0] > kFlat * spread[2])) return kNaN;
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

}  // namespace

MapEntropy map_entropy(const geometry::PointCloud& map, const MapEntropyOptions& options) {
  check(map, options);
  const geometry::NearestIndex index(map.positions);
  std::vector<double> entropies(map.size(), kNaN);
  tbb::parallel_for(std::size_t{0}, map.size(), [&](std::size_t i) {
    const auto neighbors = index.within(map.positions[i], options.radius_m);
    if (neighbors.size() >= std::max<std::size_t>(4, options.least_neighbors))
      entropies[i] = entropy_of(covariance(map.positions, neighbors));
  });
  MapEntropy result{.radius_m = options.radius_m, .points = map.size()};
  double sum = 0.0;
  for (const double h : entropies) {
    if (std::isnan(h)) continue;
    sum += h;
    ++result.judged;
  }
  if (result.judged > 0) result.mean = sum / static_cast<double>(result.judged);
  return result;
}

MapEntropy map_entropy_from_json(const nlohmann::json& object, const std::string& where) {
  JsonReader reader(object, where, "entropy");
  MapEntropy e;
  e.radius_m = reader.number("radius");
  e.points = reader.count("points");
  e.judged = reader.count("judged");
  reader.number("share_judged");  // follows from the counts
  e.mean = reader.number("mean");
  reader.expect_all_read();
  return e;
}

nlohmann::json to_json(const MapEntropy& e) {
  const double share = e.points > 0 ? static_cast<double>(e.judged) / static_cast<double>(e.points) : 0.0;
  return {
      {"radius", e.radius_m}, {"points", e.points}, {"judged", e.judged}, {"share_judged", share}, {"mean", e.mean}};
}

}  // namespace tileflight::evaluation
