#include "tileflight/live/simulator/lidar_scanner.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "tileflight/capture/render/surface_color.h"
#include "tileflight/live/simulator/frames.h"

namespace tileflight::simulator {
namespace {

using geometry::Vec3;

/// Divergence of a beam: size of the surface spot over which colours are averaged.
constexpr double kDivergence_rad = 3e-3;

/// Columns of a rotation, and the angle that they cover.
struct Sweep {
  int columns = 1;
  double from_deg = 0.0, span_deg = 360.0;

  double azimuth_rad(int column) const { return radians(from_deg + span_deg * column / columns); }
};

Sweep make_sweep(const LidarSettings& s) {
  Sweep sweep;
  sweep.columns = std::max(1, static_cast<int>(s.points_per_second / (s.rotations_per_second * s.channels)));
  sweep.from_deg = s.horizontal_from_deg;
  double span = std::fmod(s.horizontal_to_deg - s.horizontal_from_deg, 360.0);
  if (span <= 0.0) span += 360.0;
  // AirSim's default, 0 to 359, means a full rotation.
  sweep.span_deg = span >= 359.0 ? 360.0 : span;
  return sweep;
}

double elevation_rad(const LidarSettings& s, int channel) {
  const double share = s.channels > 1 ? static_cast<double>(channel) / (s.channels - 1) : 0.5;
  return radians(s.lower_deg + share * (s.upper_deg - s.lower_deg));
}

}  // namespace

double rays_per_rad(const LidarSettings& settings) {
  const Sweep sweep = make_sweep(settings);
  const double across = sweep.columns / radians(sweep.span_deg);
  const double height_rad = radians(std::abs(settings.upper_deg - settings.lower_deg));
  return std::max(across, height_rad > 1e-3 ? (settings.channels - 1) / height_rad : 0.0);
}

std::vector<LidarReturn> scan_lidar(const ResidentScene& place, const LidarSettings& settings,
                                    const geometry::SE3& T_local_sensor) {
  const Sweep sweep = make_sweep(settings);
  const render::Reflectance reflectance(place.scene(), *place.appearance());
  const auto rays = static_cast<std::size_t>(sweep.columns) * static_cast<std::size_t>(settings.channels);
  std::vector<std::optional<LidarReturn>> returns(rays);
  const auto cast = [&](std::size_t i) -> std::optional<LidarReturn> {
    const int column = static_cast<int>(i / static_cast<std::size_t>(settings.channels));
    const int channel = static_cast<int>(i % static_cast<std::size_t>(settings.channels));
    const Vec3 direction = sensor_direction(sweep.azimuth_rad(column), elevation_rad(settings, channel));
    const Vec3 direction_local = T_local_sensor.rotation * direction;
    const auto hit = place.scene().intersect({T_local_sensor.translation, direction_local}, settings.range_m);
    if (!hit) return std::nullopt;
    const double cosine = std::abs(place.scene().normal(*hit).dot(direction_local));
    const double albedo = reflectance.at(*hit, kDivergence_rad * hit->distance_m);
    const double turn_s = sweep.span_deg / 360.0 / settings.rotations_per_second;
    return LidarReturn{hit->distance_m * direction, static_cast<float>(albedo * cosine),
                       static_cast<float>(turn_s * column / sweep.columns), static_cast<std::uint16_t>(channel),
                       place.objects().index_of(hit->mesh, hit->triangle)};
  };
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays, 512), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) returns[i] = cast(i);
  });
  std::vector<LidarReturn> scan;
  for (const auto& one : returns) {
    if (one) scan.push_back(*one);
  }
  return scan;
}

}  // namespace tileflight::simulator
