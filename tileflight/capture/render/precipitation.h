#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/capture/render/weather.h"
#include "tileflight/core/geometry/mesh.h"
#include "tileflight/core/geometry/transform.h"

// Drops and flakes: how many of each size there are, how they fall, and where each one is.
namespace tileflight::render {

/// Number of drops by their diameter D: per_m3_mm exp(-slope_per_mm D) for each cubic metre and millimetre.
struct SizeDistribution {
  double per_m3_mm = 0.0;
  double slope_per_mm = 1.0;

  /// Returns the number of drops in a cubic metre with diameters from `low_mm` to `high_mm`.
  double count_per_m3(double low_mm, double high_mm) const;
};

/// Returns the size distribution of rain: Marshall and Palmer, "The distribution of raindrops with size", J.
/// Meteorology 5, 1948.
SizeDistribution marshall_palmer(double rain_mm_per_h);
/// Returns the size distribution of snow, by the diameter of the drop that a flake melts to: Gunn and Marshall, "The
/// distribution with size of aggregate snowflakes", J. Meteorology 15, 1958; the rate is that of the water.
SizeDistribution gunn_marshall(double snow_mm_per_h);

/// Returns the terminal speed of a drop, m/s: 9.65 - 10.3 exp(-0.6 D) (Atlas, Srivastava and Sekhon, Rev. Geophysics
/// 11, 1973, who fit the measurements of Gunn and Kinzer 1949).
double drop_speed_m_s(double diameter_mm);
/// Returns the terminal speed of an aggregate of dendrites, m/s, by its melted diameter: 160 D^0.3 cm/s, D in cm
/// (Langleben, "The terminal velocity of snowflakes", Quarterly J. R. Meteorological Society 80, 1954).
double flake_speed_m_s(double melted_diameter_mm);
/// Returns the diameter of the sphere that a flake fills, by its melted diameter: fresh snow of 100 kg/m3.
double flake_diameter_mm(double melted_diameter_mm);

enum class PrecipitationKind { kRain, kSnow };

/// A drop or flake at some time.
struct Particle {
  geometry::Vec3 position;  ///< local frame
  double diameter_m = 0.0;
};

/// All drops (or flakes) of one size class. They move alike, so that in a frame that falls with them they rest: there,
/// they are a Poisson process that is drawn cell by cell from hashes of the seed and the cell. Any camera at any time
/// sees the same ones.
class ParticleClass {
 public:
  /// `low_mm`, `high_mm`: bounds of the class, of drops or melted flakes.
  ParticleClass(PrecipitationKind kind, const SizeDistribution& sizes, double low_mm, double high_mm,
                const geometry::Vec3& wind_m_s, std::uint64_t key);

  double count_per_m3() const { return count_per_m3_; }
  const geometry::Vec3& velocity_m_s() const { return velocity_m_s_; }
  double mean_diameter_m() const { return mean_diameter_m_; }
  double cell_m() const { return cell_m_; }

  /// A cell of the falling frame: positions of its particles at time t are inside [cell_m * index, cell_m * (index +
  /// 1)] plus velocity times t.
  using Cell = std::array<std::int64_t, 3>;
  /// Returns the first and last cell, at this time, that a box of the local frame touches.
  std::array<Cell, 2> cells_of(const geometry::Box3& box, double time_s) const;
  /// Returns the middle of a cell at this time, local frame.
  geometry::Vec3 middle_of(const Cell& cell, double time_s) const;
  /// Appends the cell's particles at this time.
  void add_particles(const Cell& cell, double time_s, std::vector<Particle>& particles) const;

 private:
  double diameter_m(double uniform) const;

  PrecipitationKind kind_;
  double slope_per_mm_, low_mm_, high_mm_;
  double count_per_m3_, mean_diameter_m_, cell_m_;
  double empty_share_;  ///< of the cells, those without a particle
  geometry::Vec3 velocity_m_s_;
  std::uint64_t key_;
};

/// Makes the size classes of rain or snow: drops from 0.5 to 6 mm (smaller ones are not seen one by one), or flakes
/// that melt to 0.5 to 5 mm.
std::vector<ParticleClass> particle_classes(PrecipitationKind kind, const WeatherOptions& weather);

/// Returns all particles of these classes in a box at a time, in a fixed order.
std::vector<Particle> particles_in(const std::vector<ParticleClass>& classes, const geometry::Box3& box, double time_s);

}  // namespace tileflight::render
