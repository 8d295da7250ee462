#include "tileflight/capture/sensors/lidar_pattern.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {
namespace {

using geometry::Vec3;

using geometry::kRadiansPerDegree;
constexpr double kMaxBeams = 1e7;

/// Azimuth clockwise from x (to the right), elevation positive upwards.
Vec3 beam_direction(double azimuth_rad, double elevation_rad) {
  return {std::cos(elevation_rad) * std::cos(azimuth_rad), -std::cos(elevation_rad) * std::sin(azimuth_rad),
          std::sin(elevation_rad)};
}

/// The rank of each channel's elevation.
std::vector<std::uint16_t> rings_of(const std::vector<double>& elevations) {
  std::vector<std::uint16_t> order(elevations.size()), rings(elevations.size());
  std::iota(order.begin(), order.end(), std::uint16_t{0});
  std::stable_sort(order.begin(), order.end(), [&](auto a, auto b) { return elevations[a] < elevations[b]; });
  for (std::size_t rank = 0; rank < order.size(); ++rank) rings[order[rank]] = static_cast<std::uint16_t>(rank);
  return rings;
}

/// A rotation starts at the back (azimuth -180), which puts its seam there.
std::vector<LidarBeam> beams(const SpinningPattern& pattern, std::uint64_t /*scan*/) {
  const std::vector<std::uint16_t> rings = rings_of(pattern.elevations_deg);
  const double turn_s = 1.0 / pattern.rate_hz;
  std::vector<LidarBeam> result;
  for (int column = 0; column < pattern.columns; ++column) {
    for (std::size_t channel = 0; channel < rings.size(); ++channel) {
      const double time_s = column * turn_s / pattern.columns + static_cast<double>(channel) * pattern.channel_delay_s;
      const double azimuth_deg = -180.0 + 360.0 * time_s / turn_s;
      if (azimuth_deg < pattern.azimuth_from_deg || azimuth_deg > pattern.azimuth_to_deg) continue;
      result.push_back(
          {beam_direction(azimuth_deg * kRadiansPerDegree, pattern.elevations_deg[channel] * kRadiansPerDegree), time_s,
           rings[channel]});
    }
  }
  return result;
}

/// Each prism deflects the beam by a quarter of the field of view towards its own direction; for small angles the
/// deflections add up to the beam's offset from x.
std::vector<LidarBeam> beams(const RosettePattern& pattern, std::uint64_t scan) {
  const auto first =
      static_cast<std::uint64_t>(std::llround(static_cast<double>(scan) * pattern.points_per_second / pattern.rate_hz));
  const auto last = static_cast<std::uint64_t>(
      std::llround(static_cast<double>(scan + 1) * pattern.points_per_second / pattern.rate_hz));
  const double deflection_rad = pattern.fov_deg * kRadiansPerDegree / 4.0;
  const double radians_per_minute = 2.0 * std::numbers::pi / 60.0;
  std::vector<LidarBeam> result;
  for (std::uint64_t i = first; i < last; ++i) {
    const double time_s = static_cast<double>(i) / pattern.points_per_second;
    const double a = pattern.first_prism_rpm * radians_per_minute * time_s;
    const double b = pattern.second_prism_rpm * radians_per_minute * time_s;
    const Eigen::Vector2d side = deflection_rad * Eigen::Vector2d(std::cos(a) + std::cos(b), std::sin(a) + std::sin(b));
    const double angle = side.norm(), across = angle > 0.0 ? std::sin(angle) / angle : 1.0;
    result.push_back({Vec3(std::cos(angle), across * side.x(), across * side.y()),
                      std::max(0.0, time_s - static_cast<double>(scan) / pattern.rate_hz), 0});
  }
  return result;
}

std::vector<LidarBeam> beams(const RasterPattern& pattern, std::uint64_t /*scan*/) {
  const double period_s = 1.0 / pattern.rate_hz;
  const auto angle = [](int i, int count, double fov_deg) {
    return ((i + 0.5) / count - 0.5) * fov_deg * kRadiansPerDegree;
  };
  std::vector<LidarBeam> result;
  for (int row = 0; row < pattern.rows; ++row) {
    for (int column = 0; column < pattern.columns; ++column) {
      const double share = (row + (column + 0.5) / pattern.columns) / pattern.rows;
      result.push_back({beam_direction(angle(column, pattern.columns, pattern.horizontal_fov_deg),
                                       -angle(row, pattern.rows, pattern.vertical_fov_deg)),
                        share * period_s, static_cast<std::uint16_t>(row)});
    }
  }
  return result;
}

void check_one(const SpinningPattern& pattern) {
  base::require(pattern.columns >= 1 && !pattern.elevations_deg.empty(), "lidar columns",
                "and channels must be 1 or more");
  base::require(pattern.columns * static_cast<double>(pattern.elevations_deg.size()) <= kMaxBeams, "lidar columns",
                "times channels must be at most ten million");
  for (const double elevation : pattern.elevations_deg)
    base::require(std::abs(elevation) <= 90.0, "lidar elevations", "must lie between -90 and 90 degrees");
  const double column_s = 1.0 / (pattern.rate_hz * pattern.columns);
  base::require(
      pattern.channel_delay_s >= 0.0 &&
          pattern.channel_delay_s * static_cast<double>(pattern.elevations_deg.size()) <= column_s * (1 + 1e-9),
      "lidar channel_delay", "must be 0 or more, and all channels must fit into the time of a column");
  base::require(pattern.azimuth_from_deg < pattern.azimuth_to_deg, "lidar azimuth",
                "must be given in increasing order");
}

void check_one(const RosettePattern& pattern) {
  base::require(
      pattern.points_per_second >= pattern.rate_hz && pattern.points_per_second <= kMaxBeams * pattern.rate_hz,
      "lidar points_per_second", "must give one to ten million beams a scan");
  base::require(pattern.fov_deg > 0.0 && pattern.fov_deg < 180.0, "lidar fov", "must lie between 0 and 180 degrees");
  base::require(std::isfinite(pattern.first_prism_rpm + pattern.second_prism_rpm), "lidar prism_rpm", "must be finite");
}

void check_one(const RasterPattern& pattern) {
  base::require(pattern.columns >= 1 && pattern.rows >= 1 && pattern.rows <= 65536, "lidar rows",
                "and columns must be 1 or more");
  base::require(static_cast<double>(pattern.columns) * pattern.rows <= kMaxBeams, "lidar columns",
                "times rows must be at most ten million");
  base::require(pattern.horizontal_fov_deg > 0.0 && pattern.horizontal_fov_deg <= 360.0, "lidar horizontal_fov",
                "must lie between 0 and 360 degrees");
  base::require(pattern.vertical_fov_deg > 0.0 && pattern.vertical_fov_deg <= 180.0, "lidar vertical_fov",
                "must lie between 0 and 180 degrees");
}

}  // namespace

double scan_period_s(const LidarPattern& pattern) {
  return 1.0 / std::visit([](const auto& p) { return p.rate_hz; }, pattern);
}

std::vector<LidarBeam> generate_beams(const LidarPattern& pattern, std::uint64_t scan) {
  return std::visit([scan](const auto& p) { return beams(p, scan); }, pattern);
}

void check(const LidarPattern& pattern) {
  const double rate_hz = 1.0 / scan_period_s(pattern);
  base::require(rate_hz > 0.0 && rate_hz <= 1000.0, "lidar rate", "must lie between 0 and 1000 scans a second");
  std::visit([](const auto& p) { check_one(p); }, pattern);
}

}  // namespace tileflight::sensors
