#include "tileflight/live/simulator/range_sensors.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
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

namespace {

/// Rays start this far off the surface that mirrors them.
constexpr double kOffSurface_m = 1e-4;

double angle_rad(const Vec3& a, const Vec3& b) { return std::atan2(a.cross(b).norm(), a.dot(b)); }

/// Follows the rays of one measurement.
class EchoTracer {
 public:
  EchoTracer(const ResidentScene& place, const EchoSettings& settings, const geometry::SE3& T_local_sensor)
      : place_(place), settings_(settings), T_local_sensor_(T_local_sensor) {}

  std::optional<EchoReturn> trace(const Vec3& direction_sensor) const {
    Vec3 from = T_local_sensor_.translation;
    Vec3 direction = T_local_sensor_.rotation * direction_sensor;
    double travelled_m = 0.0;
    for (int reflections = 1; reflections <= settings_.max_reflections; ++reflections) {
      const double left_m = settings_.max_distance_m - travelled_m;
      const double reach_m = reflections == 1 ? left_m : std::min(left_m, settings_.max_reflection_distance_m);
      const auto hit = reach_m > 0.0 ? place_.scene().intersect({from, direction}, reach_m) : std::nullopt;
      if (!hit) return std::nullopt;
      travelled_m += hit->distance_m;
      Vec3 normal = place_.scene().normal(*hit);
      if (normal.dot(direction) > 0.0) normal = -normal;
      const Vec3 mirrored = direction - 2.0 * direction.dot(normal) * normal;
      from = place_.scene().position(*hit) + kOffSurface_m * normal;
      const std::uint32_t object = place_.objects().index_of(hit->mesh, hit->triangle);
      if (auto echo = scattered_back(from, mirrored, travelled_m, reflections)) {
        echo->object = object;
        return echo;
      }
      direction = mirrored;
    }
    return std::nullopt;
  }

 private:
  std::optional<EchoReturn> scattered_back(const Vec3& from, const Vec3& mirrored, double travelled_m,
                                           int reflections) const {
    const Vec3 back = T_local_sensor_.translation - from;
    const double total_m = travelled_m + back.norm();
    const double attenuation_db =
        -(settings_.attenuation_db_m * total_m + settings_.attenuation_db_reflection * reflections);
    if (total_m > settings_.max_distance_m || attenuation_db < settings_.attenuation_limit_db) return std::nullopt;
    if (angle_rad(mirrored, back) > radians(settings_.opening_angle_deg)) return std::nullopt;
    const Vec3 point_sensor = T_local_sensor_.inverse() * from;
    if (!is_received_from(point_sensor)) return std::nullopt;
    if (place_.scene().is_occluded({from, back.normalized()}, back.norm())) return std::nullopt;
    return EchoReturn{point_sensor, attenuation_db, total_m, reflections, 0};
  }

  bool is_received_from(const Vec3& point_sensor) const {
    const double azimuth_deg = degrees(std::atan2(point_sensor.y(), point_sensor.x()));
    const double elevation_deg = degrees(std::atan2(-point_sensor.z(), point_sensor.head<2>().norm()));
    return azimuth_deg >= settings_.azimuth_from_deg && azimuth_deg <= settings_.azimuth_to_deg &&
           elevation_deg >= settings_.elevation_from_deg && elevation_deg <= settings_.elevation_to_deg;
  }

  const ResidentScene& place_;
  const EchoSettings& settings_;
  geometry::SE3 T_local_sensor_;
};

}  // namespace

std::vector<Vec3> echo_directions(const EchoSettings& settings) {
  const int count = std::abs(settings.traces);
  const double azimuth_span_deg = settings.azimuth_to_deg - settings.azimuth_from_deg;
  const double low = std::sin(radians(settings.elevation_from_deg));
  const double high = std::sin(radians(settings.elevation_to_deg));
  constexpr double kGoldenStep = std::numbers::phi - 1.0;
  std::vector<Vec3> directions;
  for (int i = 0; i < count; ++i) {
    const double share = (i + 0.5) / count;
    const bool in_plane = settings.traces < 0;
    const double around = in_plane ? share : std::fmod(i * kGoldenStep, 1.0);
    const double elevation_rad = in_plane ? 0.0 : std::asin(low + share * (high - low));
    directions.push_back(
        sensor_direction(radians(settings.azimuth_from_deg + around * azimuth_span_deg), elevation_rad));
  }
  return directions;
}

std::vector<EchoReturn> sense_echoes(const ResidentScene& place, const EchoSettings& settings,
                                     const geometry::SE3& T_local_sensor) {
  const std::vector<Vec3> directions = echo_directions(settings);
  const EchoTracer tracer(place, settings, T_local_sensor);
  std::vector<std::optional<EchoReturn>> traced(directions.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, directions.size(), 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) traced[i] = tracer.trace(directions[i]);
  });
  std::vector<EchoReturn> echoes;
  for (const auto& one : traced) {
    if (one) echoes.push_back(*one);
  }
  return echoes;
}

}  // namespace tileflight::simulator
