#include "tileflight/evaluation/scoring/tiled_scores.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "tileflight/core/alignment/normals.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/core/geometry/point_order.h"
#include "tileflight/evaluation/metrics/map_entropy.h"
#include "tileflight/evaluation/metrics/part_search.h"

namespace tileflight::scoring {
namespace {

using geometry::Box3;
using geometry::Vec3;
using metrics::MapEntropyOptions;
using Place = MapTiles::Place;

constexpr double kFar = std::numeric_limits<double>::infinity();
/// Widens a bound by more than rounding errors.
constexpr double kWider = 1.0 + 1e-9;

/// The samples in each tile, by their places in `samples`.
std::vector<std::vector<std::size_t>> by_tile(const std::vector<Place>& samples, std::size_t tiles) {
  std::vector<std::vector<std::size_t>> result(tiles);
  for (std::size_t k = 0; k < samples.size(); ++k) result[samples[k].tile].push_back(k);
  return result;
}

/// Squared distance as geometry::NearestIndex has it, to the last digit.
double distance2(const Vec3& a, const Vec3& b) {
  double sum = 0.0;
  for (int axis = 0; axis < 3; ++axis) sum += (a[axis] - b[axis]) * (a[axis] - b[axis]);
  return sum;
}

/// Points of the map within the radius of the probes, all together.
double count_neighbors(const MapTiles& map, const std::vector<Vec3>& probes, double radius_m) {
  std::atomic<std::size_t> sum = 0;
  const double radius2 = radius_m * radius_m;
  for (std::size_t tile = 0; tile < map.size(); ++tile) {
    const MapTiles::Points points = map.read(tile);
    tbb::parallel_for(std::size_t{0}, probes.size(), [&](std::size_t k) {
      if (map.bounds()[tile].squaredExteriorDistance(probes[k]) > kWider * radius2) return;
      sum += static_cast<std::size_t>(
          std::ranges::count_if(points.positions, [&](const Vec3& p) { return distance2(probes[k], p) <= radius2; }));
    });
  }
  return static_cast<double>(sum);
}

/// The points to evaluate: as metrics::map_entropy() chooses them.
std::vector<Place> entropy_places(const MapTiles& map, const MapEntropyOptions& options) {
  const std::vector<Place> asked = map.sample_evenly(options.max_points);
  const std::vector<Vec3> probes = map.at(metrics::evenly_of(asked, metrics::kEntropyProbes)).positions;
  const std::size_t most =
      metrics::entropy_samples(count_neighbors(map, probes, options.radius_m), probes.size(), options);
  return asked.size() == map.points() ? map.sample_evenly(most) : metrics::evenly_of(asked, most);
}

/// The nearest points of a map to a place, found tile by tile.
class NearestSoFar {
 public:
  /// Adds the `count` nearest of one tile; the distance of the last of the `count` nearest so far, infinity if there
  /// are fewer.
  double add(const geometry::NearestIndex& index, const MapTiles::Points& tile, const Vec3& place, std::size_t count) {
    for (const geometry::Neighbor& n : index.nearest_k(place, count)) {
      const Vec3& p = tile.positions[n.index];
      found_.push_back({distance2(place, p), tile.numbers[n.index], p});
    }
    std::ranges::sort(found_, std::less<>(), [](const Found& f) { return std::pair(f.distance2, f.number); });
    if (found_.size() > count) found_.resize(count);
    return found_.size() == count ? std::sqrt(found_.back().distance2) : kFar;
  }

  Vec3 normal(const Vec3& place) const {
    std::vector<Vec3> points;
    for (const Found& f : found_) points.push_back(f.position);
    return alignment::estimate_normal(points, geometry::NearestIndex(points), place, points.size());
  }

 private:
  struct Found {
    double distance2;      ///< square metres
    std::uint32_t number;  ///< in the map
    Vec3 position;
  };
  std::vector<Found> found_;  ///< nearest first; of those equally far the first in the map
};

}  // namespace

std::vector<double> distances_to_voxels(const MapTiles& map, std::size_t points,
                                        const ground_truth::TruthFolder& truth) {
  VoxelCenters centers(truth);
  std::vector<double> distances(points);
  for (std::size_t tile = 0; tile < map.size(); ++tile) {
    MapTiles::Points part = map.read(tile);
    const std::vector<double> found = centers.distances({std::move(part.positions), {}, {}, {}}, "map");
    for (std::size_t i = 0; i < found.size(); ++i) distances[part.numbers[i]] = found[i];
  }
  return distances;
}

SurfaceMatch match_tiles(const MapTiles& map, std::size_t points, TruthSurface& surface,
                         const std::vector<std::uint32_t>& chosen, double within_m) {
  std::vector<std::pair<std::uint32_t, std::size_t>> sorted;  // number, place in `chosen`
  for (std::size_t k = 0; k < chosen.size(); ++k) sorted.emplace_back(chosen[k], k);
  std::ranges::sort(sorted);
  SurfaceMatch match{std::vector<double>(points), std::vector<Vec3>(chosen.size())};
  for (std::size_t tile = 0; tile < map.size(); ++tile) {
    MapTiles::Points part = map.read(tile);
    std::vector<std::uint32_t> places;  // of the chosen in the tile
    std::vector<std::size_t> asked;     // which these are
    auto next = sorted.begin();
    for (std::size_t i = 0; i < part.numbers.size(); ++i) {
      while (next != sorted.end() && next->first < part.numbers[i]) ++next;
      if (next == sorted.end() || next->first != part.numbers[i]) continue;
      places.push_back(static_cast<std::uint32_t>(i));
      asked.push_back(next->second);
    }
    const SurfaceMatch found = surface.match({std::move(part.positions), {}, {}, {}}, places, within_m);
    for (std::size_t i = 0; i < part.numbers.size(); ++i) match.distances_m[part.numbers[i]] = found.distances_m[i];
    for (std::size_t k = 0; k < asked.size(); ++k) match.directions[asked[k]] = found.directions[k];
  }
  return match;
}

metrics::MapEntropy map_entropy(const MapTiles& map, const MapEntropyOptions& options) {
  if (!(options.radius_m > 0.0) || !std::isfinite(options.radius_m))
    throw InputError("radius of the map's entropy", "must be above zero, in metres");
  const std::vector<Place> samples = entropy_places(map, options);
  std::vector<double> entropies(samples.size());
  const auto samples_of = by_tile(samples, map.size());
  for (std::size_t tile = 0; tile < map.size(); ++tile) {
    if (samples_of[tile].empty()) continue;
    const std::vector<Vec3> inside = map.read(tile).positions;
    Box3 box;
    for (const std::size_t k : samples_of[tile]) box.extend(inside[samples[k].place]);
    const Vec3 margin = Vec3::Constant(kWider * options.radius_m + 1e-9);
    const std::vector<Vec3> around = map.read_within(Box3(box.min() - margin, box.max() + margin)).positions;
    const geometry::NearestIndex index(around);
    tbb::parallel_for(std::size_t{0}, samples_of[tile].size(), [&](std::size_t i) {
      const std::size_t k = samples_of[tile][i];
      entropies[k] = metrics::local_entropy(around, index, inside[samples[k].place], options);
    });
  }
  return metrics::mean_entropy(entropies, map.points(), options.radius_m);
}

CommonPlace most_common_place(const MapTiles& map) {
  CommonPlace most;
  for (std::size_t tile = 0; tile < map.size(); ++tile) {
    const std::vector<Vec3> points = map.read(tile).positions;
    CommonPlace here;
    for (const std::uint32_t i : geometry::morton_order_of_places(points)) {
      if (here.points == 0 || here.position != points[i]) here = {points[i], 0};
      ++here.points;
      if (here.points > most.points) most = here;
    }
  }
  return most;
}

MapNeighbors find_neighbors(const MapTiles& map, const std::vector<Vec3>& points, const std::vector<Vec3>& at,
                            std::size_t neighbors) {
  std::vector<Vec3> asked = points;
  asked.insert(asked.end(), at.begin(), at.end());
  std::vector<double> reach_m(asked.size(), kFar);
  std::vector<NearestSoFar> nearest_at(at.size());
  metrics::search_parts(asked, map.bounds(), reach_m, [&](std::size_t part, const std::vector<std::uint32_t>& numbers) {
    const MapTiles::Points tile = map.read(part);
    const geometry::NearestIndex index(tile.positions);
    std::vector<std::uint32_t> for_distance, for_normal;
    for (const std::uint32_t i : numbers) (i < points.size() ? for_distance : for_normal).push_back(i);
    const auto nearest = [&](const Vec3& p, double within_m) -> std::optional<double> {
      const auto found = index.nearest(p, within_m);
      return found ? std::optional(found->distance_m) : std::nullopt;
    };
    metrics::lower_reach(asked, for_distance, nearest, reach_m);
    tbb::parallel_for(std::size_t{0}, for_normal.size(), [&](std::size_t i) {
      const std::uint32_t k = for_normal[i];
      reach_m[k] = nearest_at[k - points.size()].add(index, tile, asked[k], neighbors);
    });
  });
  MapNeighbors result{{reach_m.begin(), reach_m.begin() + static_cast<std::ptrdiff_t>(points.size())},
                      std::vector<Eigen::Vector3f>(at.size())};
  tbb::parallel_for(std::size_t{0}, at.size(),
                    [&](std::size_t k) { result.normals[k] = nearest_at[k].normal(at[k]).cast<float>(); });
  return result;
}

}  // namespace tileflight::scoring
