#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/triangle_index.h"
#include "tileflight/evaluation/metrics/distances.h"
#include "tileflight/evaluation/metrics/map_comparison.h"

namespace tileflight::tests {

/// The output function of SplitMix64 (Steele, Lea and Flood 2014): a number that looks random, from any.
inline std::uint64_t mixed(std::uint64_t z) {
  z += 0x9e3779b97f4a7c15ull;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
  return z ^ (z >> 31);
}

/// In [0, 1).
inline double as_share(std::uint64_t z) { return static_cast<double>(z >> 11) * 0x1p-53; }

/// A cube of a lattice, as a number that looks random.
inline std::uint64_t hash_of(std::uint64_t seed, std::int64_t x, std::int64_t y, std::int64_t z) {
  for (const std::int64_t c : {x, y, z}) seed = mixed(seed ^ mixed(static_cast<std::uint64_t>(c)));
  return seed;
}

/// A random field over space: random values at the corners of a lattice, blended in between, so that places nearer than
/// a lattice's edge are alike and those farther than two edges are not. Mean 0, variance 1 everywhere.
class SmoothField {
 public:
  SmoothField(std::uint64_t seed, double edge_m) : seed_(seed), edge_m_(edge_m) {}

  double at(const geometry::Vec3& p) const {
    const geometry::Vec3 q = p / edge_m_, low = q.array().floor();
    std::array<std::array<double, 2>, 3> weights{};           // of each axis: at the corners below and above
    std::array<std::array<std::uint64_t, 2>, 3> scrambled{};  // their coordinates, for hash_of()
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double below = low[static_cast<int>(axis)], part = q[static_cast<int>(axis)] - below;
      const double smooth = part * part * (3.0 - 2.0 * part);
      const auto at = static_cast<std::int64_t>(below);
      weights[axis] = {1.0 - smooth, smooth};
      scrambled[axis] = {mixed(static_cast<std::uint64_t>(at)), mixed(static_cast<std::uint64_t>(at + 1))};
    }
    std::array<std::uint64_t, 4> hashes{};  // of the first two axes
    for (std::size_t xy = 0; xy < 4; ++xy)
      hashes[xy] = mixed(mixed(seed_ ^ scrambled[0][xy & 1U]) ^ scrambled[1][xy >> 1U]);
    double sum = 0.0, squares = 0.0;
    for (std::size_t corner = 0; corner < 8; ++corner) {
      const std::size_t xy = corner & 3U, z = corner >> 2U;
      const double weight = weights[0][xy & 1U] * weights[1][xy >> 1U] * weights[2][z];
      sum += weight * value_from(mixed(hashes[xy] ^ scrambled[2][z]));
      squares += weight * weight;
    }
    return sum / std::sqrt(squares);
  }

 private:
  /// Even between -sqrt(3) and sqrt(3).
  static double value_from(std::uint64_t z) { return std::sqrt(12.0) * (as_share(z) - 0.5); }

  std::uint64_t seed_;
  double edge_m_;
};

/// Rolling ground with houses, made anew from a seed, and even samples of all its surface.
class SyntheticPlace {
 public:
  struct Wall {
    geometry::Vec3 corner, along, up;
  };

  SyntheticPlace(std::uint64_t seed, double side_m, double samples_per_m2 = 4.0) : seed_(seed), side_m_(side_m) {
    std::mt19937_64 random(seed);
    add_ground(samples_per_m2, random);
    const int houses = static_cast<int>(side_m * side_m / 900.0);
    for (int k = 0; k < houses; ++k) add_house(samples_per_m2, random);
  }

  std::uint64_t seed() const { return seed_; }
  double side_m() const { return side_m_; }
  const geometry::TriangleMesh& mesh() const { return mesh_; }
  const std::vector<geometry::Vec3>& samples() const { return samples_; }
  const std::vector<Wall>& walls() const { return walls_; }

 private:
  using Vec3 = geometry::Vec3;

  double height_m(double x, double y) const { return 2.0 * std::sin(x / 17.0) * std::cos(y / 23.0); }

  void add_quad(const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d, double per_m2, std::mt19937_64& random) {
    const auto first = static_cast<std::uint32_t>(mesh_.vertices.size());
    for (const Vec3& v : {a, b, c, d}) mesh_.vertices.push_back(v);
    for (const geometry::Triangle& t : {geometry::Triangle{0, 1, 2}, geometry::Triangle{0, 2, 3}}) {
      mesh_.triangles.push_back({first + t[0], first + t[1], first + t[2]});
      const Vec3 &p = mesh_.vertices[first + t[0]], &q = mesh_.vertices[first + t[1]],
                 &r = mesh_.vertices[first + t[2]];
      std::uniform_real_distribution<double> unit(0.0, 1.0);
      const double expected = 0.5 * (q - p).cross(r - p).norm() * per_m2;
      const int count = static_cast<int>(expected + unit(random));
      for (int k = 0; k < count; ++k) {
        const double s = std::sqrt(unit(random)), w = unit(random);
        samples_.push_back((1.0 - s) * p + s * ((1.0 - w) * q + w * r));
      }
    }
  }

  void add_ground(double per_m2, std::mt19937_64& random) {
    constexpr double kStep_m = 4.0;
    const int cells = static_cast<int>(side_m_ / kStep_m);
    const auto at = [&](int i, int j) -> Vec3 {
      return {kStep_m * i, kStep_m * j, height_m(kStep_m * i, kStep_m * j)};
    };
    for (int i = 0; i < cells; ++i) {
      for (int j = 0; j < cells; ++j) add_quad(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1), per_m2, random);
    }
  }

  void add_house(double per_m2, std::mt19937_64& random) {
    std::uniform_real_distribution<double> place(5.0, side_m_ - 25.0), size(6.0, 18.0), height(4.0, 12.0);
    const double x = place(random), y = place(random), w = size(random), l = size(random), h = height(random);
    const double z = height_m(x, y) - 1.0;
    const std::array<Vec3, 4> corner{Vec3(x, y, z), Vec3(x + w, y, z), Vec3(x + w, y + l, z), Vec3(x, y + l, z)};
    const Vec3 up(0, 0, h);
    for (std::size_t k = 0; k < 4; ++k) {
      const Vec3 &a = corner[k], &b = corner[(k + 1) % 4];
      add_quad(a, b, b + up, a + up, per_m2, random);
      walls_.push_back({a, b - a, up});
    }
    add_quad(corner[0] + up, corner[1] + up, corner[2] + up, corner[3] + up, per_m2, random);
  }

  std::uint64_t seed_;
  double side_m_;
  geometry::TriangleMesh mesh_;
  std::vector<Vec3> samples_;
  std::vector<Wall> walls_;
};

/// Parameters of a synthetic map.
struct MapKind {
  std::size_t points = 10000;  ///< those that fall into gaps and missing parts not yet taken away
  double noise_m = 0.05;       ///< along the ray, at 40 m; it grows with the distance
  double gaps = 0.01;          ///< share of the surface without points, in blobs of some metres, anew in every map
  double own_choice = 0.15;    ///< how much the density of points differs between maps, as a logarithm
  double missing_share = 0.0;  ///< of the surface beyond the gaps, in patches
  double patch_m = 5.0;        ///< edge of the patches, cubes of a lattice
  double wall_share = 0.0;     ///< of the place's largest wall, a rectangle in its middle
  double correlation_m = 6.0;  ///< edge of the lattice over which neighbours' errors are alike
  double shared = 0.5;         ///< of the errors' variance: what all maps of a place have in common
};

/// Decides which parts of the surface this kind of map lacks beyond its gaps.
class MissingSurface {
 public:
  MissingSurface(const SyntheticPlace& place, const MapKind& kind, std::uint64_t seed)
      : seed_(seed), patch_m_(kind.patch_m), wall_half_(0.5 * std::sqrt(kind.wall_share)) {
    if (kind.missing_share > 0.0) choose_patches(place, kind.missing_share);
    if (kind.wall_share > 0.0 && !place.walls().empty()) {
      const auto area = [](const SyntheticPlace::Wall& w) { return w.along.norm() * w.up.norm(); };
      wall_ = *std::max_element(place.walls().begin(), place.walls().end(),
                                [&](const auto& a, const auto& b) { return area(a) < area(b); });
    }
  }

  bool holds(const geometry::Vec3& p) const {
    if (last_rank_ > 0 && rank_of(p) <= last_rank_) return true;
    if (!wall_) return false;
    const geometry::Vec3 offset = p - wall_->corner;
    const double u = offset.dot(wall_->along) / wall_->along.squaredNorm();
    const double v = offset.dot(wall_->up) / wall_->up.squaredNorm();
    const double away_m = std::abs(offset.dot(wall_->along.cross(wall_->up).normalized()));
    return away_m < 1e-6 && std::abs(u - 0.5) <= wall_half_ && std::abs(v - 0.5) <= wall_half_;
  }

 private:
  /// Returns the rank of the patch around a point. Patches are missing in the order of their ranks.
  std::uint64_t rank_of(const geometry::Vec3& p) const {
    const geometry::Vec3 cube = (p / patch_m_).array().floor();
    const auto along = [&](int axis) { return static_cast<std::int64_t>(cube[axis]); };
    return hash_of(seed_, along(0), along(1), along(2));
  }

  /// Chooses so many patches that this share of the samples is missing, to within one patch.
  void choose_patches(const SyntheticPlace& place, double share) {
    std::map<std::uint64_t, std::size_t> samples_of_rank;
    for (const geometry::Vec3& p : place.samples()) ++samples_of_rank[rank_of(p)];
    const double wanted = share * static_cast<double>(place.samples().size());
    double missing = 0.0;
    for (const auto& [rank, samples] : samples_of_rank) {
      if (missing + 0.5 * static_cast<double>(samples) > wanted) break;
      missing += static_cast<double>(samples);
      last_rank_ = rank;
    }
  }

  std::uint64_t seed_, last_rank_ = 0;
  double patch_m_, wall_half_;
  std::optional<SyntheticPlace::Wall> wall_;
};

/// Above which the share of a smooth field of one lattice lies.
inline double level_of(double share) {
  const SmoothField field(1, 1.0);
  std::vector<double> values;
  for (int k = 0; k < 20000; ++k) values.push_back(field.at({0.37 * k, 0.73 * (k % 101), 0.59 * (k % 17)}));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>((1.0 - share) * 19999.0);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

/// A map of the place as odometry leaves it: dense where there is texture (the place's and its own choice of it), with
/// gaps, errors along the rays of a camera that flew across at 45 m, alike between neighbours and partly those of every
/// map of the place, and 2 % that are far off. Another `seed`, another map of the same kind.
inline geometry::PointCloud synthetic_map(const SyntheticPlace& place, const MapKind& kind, std::uint64_t seed) {
  using geometry::Vec3;
  const std::uint64_t own = mixed(2 * seed + 1), common = mixed(2 * place.seed());
  const SmoothField texture(common, 5.0), own_texture(own, 4.0), gap(own + 1, 6.0);
  const MissingSurface missing(place, kind, own + 4);
  const double gap_level = level_of(kind.gaps);
  const SmoothField error_here(common + 1, kind.correlation_m), own_error(own + 2, kind.correlation_m);
  const SmoothField spread_here(common + 2, kind.correlation_m), own_spread(own + 3, kind.correlation_m);
  const double here = std::sqrt(kind.shared), of_own = std::sqrt(1.0 - kind.shared);
  std::mt19937_64 random(own);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::exponential_distribution<double> far(1.0);
  geometry::PointCloud map;
  for (std::size_t laid = 0; laid < kind.points;) {
    const Vec3& p = place.samples()[random() % place.samples().size()];
    if (unit(random) >= std::exp(0.7 * texture.at(p) + kind.own_choice * own_texture.at(p)) / 5.0) continue;
    ++laid;
    const Vec3 camera(place.side_m() * unit(random), place.side_m() * (0.3 + 0.4 * unit(random)), 45.0);
    const double error =
        std::sqrt(0.6) * (here * error_here.at(p) + of_own * own_error.at(p)) + std::sqrt(0.4) * normal(random);
    const double spread = std::exp(0.3 * (here * spread_here.at(p) + of_own * own_spread.at(p)));
    const Vec3 ray = p - camera;
    const bool is_far = unit(random) < 0.02;
    const double off_m = is_far ? far(random) : kind.noise_m * spread * error * ray.norm() / 40.0;
    if (gap.at(p) > gap_level || missing.holds(p)) continue;
    map.positions.push_back(p + off_m * ray.normalized());
  }
  return map;
}

/// Scored as `evaluate` does, all of the surface having been seen.
inline metrics::ScoredMap scored(const SyntheticPlace& place, const geometry::TriangleIndex& surface,
                                 const geometry::PointCloud& map) {
  metrics::ScoredMap result;
  result.surface = {map.positions, metrics::surface_distances(map, surface), map.size()};
  geometry::PointCloud samples;
  samples.positions = place.samples();
  result.seen = {place.samples(), metrics::cloud_distances(samples, map, "samples", "map")};
  return result;
}

}  // namespace tileflight::tests
