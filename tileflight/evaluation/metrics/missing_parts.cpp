#include "tileflight/evaluation/metrics/missing_parts.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <algorithm>
#include <atomic>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <tuple>
#include <unordered_set>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/geometry/nearest.h"
#include "tileflight/evaluation/metrics/student_t.h"

namespace tileflight::metrics {

using geometry::Vec3;

namespace {

/// Step for subsampling points or samples; more of them add no information.
std::size_t thinning_step(std::size_t count) {
  constexpr std::size_t kMost = 1000000;
  return 1 + count / kMost;
}

// --------------------------------------------------------------------------------------- what both cameras saw

using CommonSamples = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

std::uint64_t hash_of(const Vec3& p) {
  std::uint64_t hash = 0;
  for (const double coordinate : p) hash = base::SplitMix64(hash ^ std::bit_cast<std::uint64_t>(coordinate)).next();
  return hash;
}

std::vector<std::pair<std::uint64_t, std::uint32_t>> hashed(const std::vector<Vec3>& points) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(points.size());
  for (std::size_t i = 0; i < points.size(); ++i) keys[i] = {hash_of(points[i]), static_cast<std::uint32_t>(i)};
  tbb::parallel_sort(keys.begin(), keys.end());
  return keys;
}

/// In the order of their hashes, which does not change if the maps are exchanged, and gives an unpatterned subsample of
/// large sets.
CommonSamples common_samples(const SeenSurface& a, const SeenSurface& b) {
  const auto of_a = hashed(a.positions), of_b = hashed(b.positions);
  CommonSamples common;
  for (std::size_t i = 0, j = 0; i < of_a.size() && j < of_b.size();) {
    const auto [hash_a, in_a] = of_a[i];
    const auto [hash_b, in_b] = of_b[j];
    if (hash_a == hash_b && a.positions[in_a] == b.positions[in_b]) common.emplace_back(in_a, in_b);
    i += hash_a <= hash_b ? 1 : 0;
    j += hash_b <= hash_a ? 1 : 0;
  }
  const std::size_t step = thinning_step(common.size());
  CommonSamples thinned;
  for (std::size_t k = 0; k < common.size(); k += step) thinned.push_back(common[k]);
  return thinned;
}

/// Numbers of map points, simulated and real.
struct Counts {
  std::array<std::uint32_t, 2> points{};

  std::uint32_t total() const { return points[0] + points[1]; }
};

/// The shared samples, with the number of points of each map assigned to each.
struct Surface {
  std::vector<Vec3> samples;
  geometry::NearestIndex index;
  std::vector<Counts> counts;

  explicit Surface(std::vector<Vec3> points) : samples(std::move(points)), index(samples), counts(samples.size()) {}
};

void count_points(const KeptDistances& map, std::size_t number, double cutoff_m, Surface& surface) {
  const std::size_t step = thinning_step(map.positions.size());
  const std::size_t taken = (map.positions.size() + step - 1) / step;
  tbb::parallel_for(std::size_t{0}, taken, [&](std::size_t k) {
    const std::size_t i = k * step;
    if (!(map.distances[i] <= cutoff_m)) return;
    if (const auto near = surface.index.nearest(map.positions[i], cutoff_m))
      std::atomic_ref(surface.counts[near->index].points[number]).fetch_add(1, std::memory_order_relaxed);
  });
}

// --------------------------------------------------------------------------------------------------------- balls

/// Balls of one size around samples, with their counts and the expected shares.
struct Balls {
  double diameter_m = 0;
  std::vector<std::uint32_t> centers;
  std::vector<Counts> counts;
  double share = 0.0, correlation = 0.0;  ///< the simulated map's share of all points; intraclass correlation within a
                                          ///< ball

  /// Effective number of independent points among n.
  double effective(double n) const { return n / (1.0 + (n - 1.0) * correlation); }
};

/// First sample of each cell of a grid.
std::vector<std::uint32_t> centers_apart(const std::vector<Vec3>& samples, double apart_m) {
  std::unordered_set<std::uint64_t> taken;
  std::vector<std::uint32_t> centers;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Vec3 cell = (samples[i] / apart_m).array().floor();
    if (taken.insert(hash_of(cell)).second) centers.push_back(static_cast<std::uint32_t>(i));
  }
  return centers;
}

template <class Visit>
void for_each_in_ball(const Surface& surface, const Balls& balls, std::size_t ball, const Visit& visit) {
  surface.index.for_each_within(surface.samples[balls.centers[ball]], 0.5 * balls.diameter_m, visit);
}

/// Intraclass correlation at which the median ball deviates as far as its effective number of points implies; over
/// balls with enough points.
double correlation_of(const Balls& balls) {
  constexpr double kEnough = 10.0, kMedianOfChiSquare = 0.4549364;
  const double p = balls.share;
  std::vector<std::pair<double, double>> deviations;  // points, squared deviation over the binomial variance
  for (const Counts& counts : balls.counts) {
    const double n = counts.total();
    if (n < kEnough) continue;
    const double off = counts.points[0] - n * p;
    deviations.emplace_back(n, off * off / (n * p * (1.0 - p)));
  }
  if (deviations.empty()) return 0.0;
  std::vector<double> scaled(deviations.size());
  const auto too_small = [&](double correlation) {
    std::ranges::transform(deviations, scaled.begin(),
                           [&](const auto& d) { return d.second / (1.0 + (d.first - 1.0) * correlation); });
    const auto middle = scaled.begin() + static_cast<std::ptrdiff_t>(scaled.size() / 2);
    std::nth_element(scaled.begin(), middle, scaled.end());
    return *middle > kMedianOfChiSquare;
  };
  if (!too_small(0.0)) return 0.0;
  double low = 0.0, high = 1.0;
  for (int k = 0; k < 20; ++k) {
    const double middle = 0.5 * (low + high);
    (too_small(middle) ? low : high) = middle;
  }
  return high;
}

Balls balls_of(const Surface& surface, double edge_m) {
  Balls balls{.diameter_m = edge_m, .centers = centers_apart(surface.samples, 0.25 * edge_m)};
  balls.counts.resize(balls.centers.size());
  tbb::parallel_for(std::size_t{0}, balls.centers.size(), [&](std::size_t k) {
    for_each_in_ball(surface, balls, k, [&](std::size_t sample) {
      for (std::size_t map = 0; map < 2; ++map) balls.counts[k].points[map] += surface.counts[sample].points[map];
    });
  });
  std::array<double, 2> all{};
  for (const Counts& counts : surface.counts) {
    for (std::size_t map = 0; map < 2; ++map) all[map] += counts.points[map];
  }
  balls.share = all[0] / (all[0] + all[1]);
  if (balls.share > 0.0 && balls.share < 1.0) balls.correlation = correlation_of(balls);
  return balls;
}

/// Probability of at most `few` successes among n; counts need not be integers.
double binomial_tail(double few, double n, double probability) {
  return few >= n ? 1.0 : incomplete_beta(1.0 - probability, n - few, few + 1.0);
}

bool overlap(const MissingPart& a, const MissingPart& b) {
  return (a.center - b.center).norm() < 0.5 * (a.diameter_m + b.diameter_m);
}

/// Probability of at most the observed number of points of a map in a ball.
double p_of(const Balls& balls, const Counts& counts, std::size_t map) {
  const double n = balls.effective(counts.total()), share = map == 0 ? balls.share : 1.0 - balls.share;
  return binomial_tail(counts.points[map] * n / counts.total(), n, share);
}

bool hardly_any(const Balls& balls, const Counts& counts, std::size_t map, const MissingPartsOptions& options) {
  const double share = map == 0 ? balls.share : 1.0 - balls.share;
  return counts.points[map] <= options.max_relative_count * counts.total() * share;
}

/// Marks the informative samples and those that a map lacks. A ball is informative if zero points of the sparser map
/// would be significant.
void mark(const Surface& surface, const Balls& balls, const MissingPartsOptions& options, MissingParts& result) {
  const auto set = [](std::vector<std::uint8_t>& flags, std::size_t sample) {
    std::atomic_ref(flags[sample]).store(1, std::memory_order_relaxed);
  };
  tbb::parallel_for(std::size_t{0}, balls.centers.size(), [&](std::size_t k) {
    const Counts& counts = balls.counts[k];
    const double rarer = std::min(balls.share, 1.0 - balls.share);
    if (counts.total() == 0 ||
        !(binomial_tail(0.0, balls.effective(counts.total()), rarer) <= options.significance_per_ball))
      return;
    std::array<bool, 2> lacks{};
    for (std::size_t map = 0; map < 2; ++map)
      lacks[map] = hardly_any(balls, counts, map, options) && p_of(balls, counts, map) <= options.significance_per_ball;
    for_each_in_ball(surface, balls, k, [&](std::size_t sample) {
      set(result.informative, sample);
      for (std::size_t map = 0; map < 2; ++map)
        if (lacks[map]) set(result.lacking[map], sample);
    });
  });
}

/// Appends the balls that one of the maps significantly lacks.
void find_parts(const Surface& surface, const Balls& balls, double tests, const MissingPartsOptions& options,
                std::vector<MissingPart>& found) {
  for (std::size_t k = 0; k < balls.centers.size(); ++k) {
    const Counts& counts = balls.counts[k];
    for (std::size_t map = 0; map < 2; ++map) {
      if (counts.total() == 0 || !hardly_any(balls, counts, map, options)) continue;
      const double p = tests * p_of(balls, counts, map);
      if (!(p <= options.significance_level)) continue;
      found.push_back(
          {surface.samples[balls.centers[k]], balls.diameter_m, {counts.points[0], counts.points[1]}, map, p});
    }
  }
}

/// Most significant first, without balls that overlap an earlier one.
std::vector<MissingPart> remove_overlapping(std::vector<MissingPart> found, std::size_t most) {
  std::sort(found.begin(), found.end(), [](const MissingPart& a, const MissingPart& b) {
    const auto key = [](const MissingPart& m) {
      return std::tuple(m.p, m.diameter_m, m.center.x(), m.center.y(), m.center.z(), m.lacking_map);
    };
    return key(a) < key(b);
  });
  std::vector<MissingPart> parts;
  for (const MissingPart& part : found) {
    if (parts.size() == most) break;
    if (std::ranges::none_of(parts, [&](const MissingPart& other) { return overlap(part, other); }))
      parts.push_back(part);
  }
  return parts;
}

void check(const MissingPartsOptions& options) {
  for (const double edge_m : options.diameters_m) {
    if (!(edge_m > 0.0) || !std::isfinite(edge_m))
      throw InputError("balls", "their diameter must be above zero, in metres");
  }
}

}  // namespace

double MissingParts::lacking_share(std::size_t map) const {
  const auto sum = [](const std::vector<std::uint8_t>& flags) {
    return std::accumulate(flags.begin(), flags.end(), 0.0);
  };
  return sum(lacking[map]) / sum(informative);
}

MissingParts missing_parts(const KeptDistances& simulated, const SeenSurface& seen_by_simulated,
                           const KeptDistances& real, const SeenSurface& seen_by_real,
                           const MissingPartsOptions& options) {
  check(options);
  MissingParts result{.options = options, .shared_samples = common_samples(seen_by_simulated, seen_by_real)};
  result.informative.assign(result.shared_samples.size(), 0);
  result.lacking.fill(result.informative);
  if (result.shared_samples.empty()) return result;
  std::vector<Vec3> samples;
  for (const auto& [in_simulated, in_real] : result.shared_samples)
    samples.push_back(seen_by_simulated.positions[in_simulated]);
  Surface surface(std::move(samples));
  count_points(simulated, 0, options.cutoff_m, surface);
  count_points(real, 1, options.cutoff_m, surface);
  std::vector<Balls> sizes;
  for (const double edge_m : options.diameters_m) {
    sizes.push_back(balls_of(surface, edge_m));
    result.balls += sizes.back().centers.size();
  }
  result.correlation = 0.0;
  std::vector<MissingPart> found;
  for (const Balls& balls : sizes) {
    if (!(balls.share > 0.0 && balls.share < 1.0)) continue;
    result.correlation = std::max(result.correlation, balls.correlation);
    mark(surface, balls, options, result);
    find_parts(surface, balls, 2.0 * static_cast<double>(result.balls), options, found);
  }
  result.parts = remove_overlapping(std::move(found), options.max_parts);
  return result;
}

nlohmann::json to_json(const MissingParts& missing) {
  nlohmann::json parts = nlohmann::json::array();
  for (const MissingPart& part : missing.parts) {
    parts.push_back({{"center", {part.center.x(), part.center.y(), part.center.z()}},
                     {"edge", part.diameter_m},
                     {"points", {{"simulated", part.points[0]}, {"real", part.points[1]}}},
                     {"lacks", part.lacking_map == 0 ? "simulated" : "real"},
                     {"p", part.p}});
  }
  return {{"balls", missing.balls}, {"correlation", missing.correlation}, {"parts", parts}};
}

}  // namespace tileflight::metrics
