#include "tileflight/capture/render/precipitation.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::render {
namespace {

using geometry::Vec3;

constexpr std::uint64_t kRainStream = 40, kSnowStream = 41;
constexpr double kMeanPerCell = 2.0;
constexpr double kLargestCell_m = 8.0;
constexpr double kLeast_mm = 0.5, kStep_mm = 0.5, kMostRain_mm = 6.0, kMostSnow_mm = 5.0;

/// Uniform in [0, 1).
double uniform_of(base::SplitMix64& random) { return static_cast<double>(random.next() >> 11U) * 0x1p-53; }

std::uint64_t cell_key(std::uint64_t key, const ParticleClass::Cell& cell) {
  for (const std::int64_t index : cell) key = base::splitmix64_hash(key ^ static_cast<std::uint64_t>(index));
  return key;
}

/// Knuth 1969, volume 2, section 3.4.1: products of uniform numbers; for small means, given as exp(-mean).
int poisson_of(base::SplitMix64& random, double empty_share) {
  int count = 0;
  for (double product = uniform_of(random); product > empty_share; product *= uniform_of(random)) ++count;
  return count;
}

/// Mean of an exponential distribution of this slope, between bounds.
double mean_between(double slope, double low, double high) {
  const double share = std::exp(-slope * (high - low));
  return 1.0 / slope + (low - high * share) / (1.0 - share);
}

}  // namespace

double SizeDistribution::count_per_m3(double low_mm, double high_mm) const {
  return per_m3_mm / slope_per_mm * (std::exp(-slope_per_mm * low_mm) - std::exp(-slope_per_mm * high_mm));
}

SizeDistribution marshall_palmer(double rain_mm_per_h) { return {8000.0, 4.1 * std::pow(rain_mm_per_h, -0.21)}; }

SizeDistribution gunn_marshall(double snow_mm_per_h) {
  return {3.8e3 * std::pow(snow_mm_per_h, -0.87), 2.55 * std::pow(snow_mm_per_h, -0.48)};
}

double drop_speed_m_s(double diameter_mm) { return std::max(0.0, 9.65 - 10.3 * std::exp(-0.6 * diameter_mm)); }

double flake_speed_m_s(double melted_diameter_mm) { return 1.6 * std::pow(0.1 * melted_diameter_mm, 0.3); }

double flake_diameter_mm(double melted_diameter_mm) {
  constexpr double kWater_kg_m3 = 1000.0, kFreshSnow_kg_m3 = 100.0;
  return melted_diameter_mm * std::cbrt(kWater_kg_m3 / kFreshSnow_kg_m3);
}

ParticleClass::ParticleClass(PrecipitationKind kind, const SizeDistribution& sizes, double low_mm, double high_mm,
                             const Vec3& wind_m_s, std::uint64_t key)
    : kind_(kind),
      slope_per_mm_(sizes.slope_per_mm),
      low_mm_(low_mm),
      high_mm_(high_mm),
      count_per_m3_(sizes.count_per_m3(low_mm, high_mm)),
      key_(key) {
  const double mean_mm = mean_between(slope_per_mm_, low_mm, high_mm);
  const bool is_rain = kind == PrecipitationKind::kRain;
  mean_diameter_m_ = 1e-3 * (is_rain ? mean_mm : flake_diameter_mm(mean_mm));
  velocity_m_s_ = wind_m_s - (is_rain ? drop_speed_m_s(mean_mm) : flake_speed_m_s(mean_mm)) * Vec3::UnitZ();
  cell_m_ = std::min(kLargestCell_m, std::cbrt(kMeanPerCell / std::max(count_per_m3_, 1e-9)));
  empty_share_ = std::exp(-count_per_m3_ * cell_m_ * cell_m_ * cell_m_);
}

std::array<ParticleClass::Cell, 2> ParticleClass::cells_of(const geometry::Box3& box, double time_s) const {
  std::array<Cell, 2> cells;
  for (int axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<std::size_t>(axis);
    const double moved_m = velocity_m_s_[axis] * time_s;
    cells[0][i] = static_cast<std::int64_t>(std::floor((box.min()[axis] - moved_m) / cell_m_));
    cells[1][i] = static_cast<std::int64_t>(std::floor((box.max()[axis] - moved_m) / cell_m_));
  }
  return cells;
}

Vec3 ParticleClass::middle_of(const Cell& cell, double time_s) const {
  const Vec3 index(static_cast<double>(cell[0]), static_cast<double>(cell[1]), static_cast<double>(cell[2]));
  return cell_m_ * (index + Vec3::Constant(0.5)) + time_s * velocity_m_s_;
}

/// The class's part of the exponential distribution, inverted.
double ParticleClass::diameter_m(double uniform) const {
  const double share = 1.0 - std::exp(-slope_per_mm_ * (high_mm_ - low_mm_));
  const double mm = low_mm_ - std::log1p(-uniform * share) / slope_per_mm_;
  return 1e-3 * (kind_ == PrecipitationKind::kRain ? mm : flake_diameter_mm(mm));
}

void ParticleClass::add_particles(const Cell& cell, double time_s, std::vector<Particle>& particles) const {
  base::SplitMix64 random(cell_key(key_, cell));
  const int count = poisson_of(random, empty_share_);
  const Vec3 corner = middle_of(cell, time_s) - Vec3::Constant(0.5 * cell_m_);
  for (int i = 0; i < count; ++i) {
    Vec3 share;
    for (int axis = 0; axis < 3; ++axis) share[axis] = uniform_of(random);
    particles.push_back({corner + cell_m_ * share, diameter_m(uniform_of(random))});
  }
}

std::vector<ParticleClass> particle_classes(PrecipitationKind kind, const WeatherOptions& weather) {
  const bool is_rain = kind == PrecipitationKind::kRain;
  const double rate = is_rain ? weather.rain_mm_per_h : weather.snow_mm_per_h;
  std::vector<ParticleClass> classes;
  if (rate <= 0.0) return classes;
  const SizeDistribution sizes = is_rain ? marshall_palmer(rate) : gunn_marshall(rate);
  const std::uint64_t key = base::stream_key(weather.seed, is_rain ? kRainStream : kSnowStream);
  const double most_mm = is_rain ? kMostRain_mm : kMostSnow_mm;
  for (double low_mm = kLeast_mm; low_mm < most_mm; low_mm += kStep_mm)
    classes.emplace_back(kind, sizes, low_mm, low_mm + kStep_mm, weather.wind_m_s,
                         base::stream_key(key, classes.size()));
  return classes;
}

std::vector<Particle> particles_in(const std::vector<ParticleClass>& classes, const geometry::Box3& box,
                                   double time_s) {
  std::vector<Particle> particles;
  for (const ParticleClass& one : classes) {
    const auto [first, last] = one.cells_of(box, time_s);
    for (std::int64_t x = first[0]; x <= last[0]; ++x)
      for (std::int64_t y = first[1]; y <= last[1]; ++y)
        for (std::int64_t z = first[2]; z <= last[2]; ++z) one.add_particles({x, y, z}, time_s, particles);
  }
  std::erase_if(particles, [&](const Particle& particle) { return !box.contains(particle.position); });
  return particles;
}

}  // namespace tileflight::render
