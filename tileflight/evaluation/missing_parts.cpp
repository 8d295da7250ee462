#include "tileflight/evaluation/missing_parts.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "tileflight/evaluation/split_mix.h"
#include "tileflight/evaluation/student_t.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::evaluation {

using geometry::Vec3;

namespace {

/// A cube by its lattice and its numbers along the axes.
struct Cube {
  std::array<std::int64_t, 3> at{};
  friend auto operator<=>(const Cube&, const Cube&) = default;
};

struct CubeHash {
  std::size_t operator()(const Cube& cube) const {
    std::uint64_t z = 0;
    for (const std::int64_t c : cube.at) z = SplitMix64(z ^ static_cast<std::uint64_t>(c)).next();
    return static_cast<std::size_t>(z);
  }
};

/// What is in a cube.
struct Content {
  std::array<std::uint32_t, 2> points{}, seen{};  ///< map points near the surface, samples seen: simulated, real

  std::uint32_t total() const { return points[0] + points[1]; }
};

using Lattice = std::unordered_map<Cube, Content, CubeHash>;

/// One of the eight ways to lay cubes of an edge: half an edge on along some of the axes.
struct Laying {
  double edge_m = 0;
  int shifted = 0;  ///< bit an axis

  double shift_m(int axis) const { return (shifted >> axis & 1) != 0 ? 0.5 * edge_m : 0.0; }
  Cube around(const Vec3& p) const {
    Cube cube;
    for (int axis = 0; axis < 3; ++axis)
      cube.at[static_cast<std::size_t>(axis)] =
          static_cast<std::int64_t>(std::floor((p[axis] + shift_m(axis)) / edge_m));
    return cube;
  }
  Vec3 center(const Cube& cube) const {
    Vec3 c;
    for (int axis = 0; axis < 3; ++axis)
      c[axis] = (static_cast<double>(cube.at[static_cast<std::size_t>(axis)]) + 0.5) * edge_m - shift_m(axis);
    return c;
  }
};

struct Flights {
  std::array<const KeptDistances*, 2> maps;
  std::array<const SeenSurface*, 2> seen;
};

/// More of either say nothing more: every so many are taken.
std::size_t step_through(std::size_t count) {
  constexpr std::size_t kMost = 1000000;
  return 1 + count / kMost;
}

/// Cubes that both cameras saw, with a map point of either.
Lattice filled(const Flights& flights, const Laying& laying, double cutoff_m) {
  Lattice cubes;
  for (std::size_t flight = 0; flight < 2; ++flight) {
    const KeptDistances& map = *flights.maps[flight];
    for (std::size_t i = 0; i < map.positions.size(); i += step_through(map.positions.size())) {
      if (map.distances[i] <= cutoff_m) ++cubes[laying.around(map.positions[i])].points[flight];
    }
  }
  for (std::size_t flight = 0; flight < 2; ++flight) {
    const std::vector<Vec3>& samples = flights.seen[flight]->positions;
    for (std::size_t i = 0; i < samples.size(); i += step_through(samples.size())) {
      if (const auto found = cubes.find(laying.around(samples[i])); found != cubes.end()) ++found->second.seen[flight];
    }
  }
  std::erase_if(cubes, [](const auto& cube) { return cube.second.seen[0] == 0 || cube.second.seen[1] == 0; });
  return cubes;
}

/// Pearson's, over cubes with points enough; at least 1.
class Dispersion {
 public:
  void add(const Content& content, double share) {
    constexpr double kEnough = 10.0;
    const double n = content.total();
    if (n < kEnough) return;
    const double off = content.points[0] - n * share;
    sum_ += off * off / (n * share * (1.0 - share));
    count_ += 1.0;
  }
  double value() const { return count_ > 0.0 ? std::max(1.0, sum_ / count_) : 1.0; }

 private:
  double sum_ = 0.0, count_ = 0.0;
};

/// Of so few points or fewer of n, each with the probability; counts need not be whole.
double binomial_tail(double few, double n, double probability) {
  return few >= n ? 1.0 : incomplete_beta(1.0 - probability, n - few, few + 1.0);
}

bool overlap(const MissingPart& a, const MissingPart& b) {
  return (a.center - b.center).cwiseAbs().maxCoeff() < 0.5 * (a.edge_m + b.edge_m) * (1.0 - 1e-9);
}

/// All cubes of one laying, and what counts of their edge are expected to be.
struct LaidCubes {
  Laying laying;
  Lattice cubes;
  double share = 0.0, dispersion = 1.0;  ///< the simulated map's of all points; how far shares deviate
};

/// Share and dispersion, from cubes that do not overlap.
void add_expectations(LaidCubes& laid) {
  std::array<double, 2> all{};
  for (const auto& [cube, content] : laid.cubes) {
    for (std::size_t map = 0; map < 2; ++map) all[map] += content.points[map];
  }
  laid.share = all[0] / (all[0] + all[1]);
  Dispersion dispersion;
  for (const auto& [cube, content] : laid.cubes) dispersion.add(content, laid.share);
  laid.dispersion = dispersion.value();
}

/// Cubes that one of the maps lacks.
void find_parts(const LaidCubes& laid, double tests, const MissingPartsOptions& options,
                std::vector<MissingPart>& found) {
  if (!(laid.share > 0.0 && laid.share < 1.0)) return;
  for (const auto& [cube, content] : laid.cubes) {
    for (std::size_t map = 0; map < 2; ++map) {
      const double of_map = map == 0 ? laid.share : 1.0 - laid.share, n = content.total();
      if (content.points[map] > options.hardly * n * of_map) continue;
      const double p = tests * binomial_tail(content.points[map] / laid.dispersion, n / laid.dispersion, of_map);
      if (!(p <= options.level)) continue;
      found.push_back({laid.laying.center(cube), laid.laying.edge_m, {content.points[0], content.points[1]}, map, p});
    }
  }
}

/// The surest first, without those that overlap one before.
std::vector<MissingPart> apart(std::vector<MissingPart> found, std::size_t most) {
  std::sort(found.begin(), found.end(), [](const MissingPart& a, const MissingPart& b) {
    const auto key = [](const MissingPart& m) {
      return std::tuple(m.p, m.edge_m, m.center.x(), m.center.y(), m.center.z(), m.lacks);
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
  for (const double edge_m : options.edges_m) {
    if (!(edge_m > 0.0) || !std::isfinite(edge_m)) throw InputError("cubes", "must have an edge above zero, in metres");
  }
}

}  // namespace

MissingParts missing_parts(const KeptDistances& simulated, const SeenSurface& seen_by_simulated,
                           const KeptDistances& real, const SeenSurface& seen_by_real,
                           const MissingPartsOptions& options) {
  check(options);
  const Flights flights{{&simulated, &real}, {&seen_by_simulated, &seen_by_real}};
  MissingParts result{.options = options};
  constexpr std::size_t kLayings = 8;
  std::vector<LaidCubes> laid(kLayings * options.edges_m.size());
  tbb::parallel_for(std::size_t{0}, laid.size(), [&](std::size_t k) {
    laid[k].laying = {options.edges_m[k / kLayings], static_cast<int>(k % kLayings)};
    laid[k].cubes = filled(flights, laid[k].laying, options.cutoff_m);
    add_expectations(laid[k]);
  });
  for (const LaidCubes& cubes : laid) result.cubes += cubes.cubes.size();
  if (result.cubes == 0) return result;
  std::vector<MissingPart> found;
  result.dispersion = 1.0;
  for (const LaidCubes& cubes : laid) {
    result.dispersion = std::max(result.dispersion, cubes.dispersion);
    find_parts(cubes, 2.0 * static_cast<double>(result.cubes), options, found);
  }
  result.parts = apart(std::move(found), options.most);
  return result;
}

nlohmann::json to_json(const MissingParts& missing) {
  nlohmann::json parts = nlohmann::json::array();
  for (const MissingPart& part : missing.parts) {
    parts.push_back({{"center", {part.center.x(), part.center.y(), part.center.z()}},
                     {"edge", part.edge_m},
                     {"points", {{"simulated", part.points[0]}, {"real", part.points[1]}}},
                     {"lacks", part.lacks == 0 ? "simulated" : "real"},
                     {"p", part.p}});
  }
  return {{"cubes", missing.cubes}, {"dispersion", missing.dispersion}, {"parts", parts}};
}

}  // namespace tileflight::evaluation
