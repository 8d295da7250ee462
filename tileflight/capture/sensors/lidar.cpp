#include "tileflight/capture/sensors/lidar.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <string>

#include "tileflight/capture/render/surface_color.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/base/strict_section.h"
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

namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::uint64_t kLidarNoise = 51, kDropoutStream = 52;
using geometry::kRadiansPerDegree;

/// A uniform number in [0, 1) that depends only on key and counter.
double uniform_number(std::uint64_t key, std::uint64_t counter) {
  return static_cast<double>(base::splitmix64_hash(key ^ base::splitmix64_hash(counter)) >> 11U) * 0x1p-53;
}

bool is_periodic(const LidarPattern& pattern) { return !std::holds_alternative<RosettePattern>(pattern); }

std::vector<double> linspace(double from, double to, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(from + (to - from) * i / (count - 1));
  return values;
}

/// Velodyne VLP-16 User Manual 63-9243 Rev. D: 16 channels of -15 to 15 degrees whose firing hops between the halves
/// (table 9-1), 2.304 us apart, 55.296 us a column (8.1), range 100 m, accuracy 3 cm, beam 3 mrad wide.
LidarOptions vlp_16() {
  LidarOptions options;
  SpinningPattern pattern;
  pattern.columns = 1808;  // 0.1 s / 55.296 us
  for (int laser = 0; laser < 16; ++laser) pattern.elevations_deg.push_back(laser % 2 == 0 ? laser - 15 : laser);
  pattern.channel_delay_s = 2.304e-6;
  options.pattern = pattern;
  options.min_range_m = 0.5;
  options.max_range_m = 100.0;
  options.range_sigma_m = 0.03;
  options.divergence_rad = 3e-3;
  return options;
}

/// Ouster OS1 data sheet (64 channels, first generation): 33.2 degrees, 1024 columns at 10 Hz, all channels at once;
/// 120 m on 80 % and 40 m on 10 % reflectance, 0.8 m at least, repeatability 1.5 cm, beam 0.13 degrees wide.
LidarOptions os1_64() {
  LidarOptions options;
  SpinningPattern pattern;
  pattern.columns = 1024;
  pattern.elevations_deg = linspace(-16.6, 16.6, 64);
  options.pattern = pattern;
  options.min_range_m = 0.8;
  options.max_range_m = 120.0;
  options.range_sigma_m = 0.015;
  options.divergence_rad = 0.13 * kRadiansPerDegree;
  options.white_range_m = 120.0 / std::sqrt(0.8);
  return options;
}

/// Velodyne HDL-64E S2 User's Manual: 32 channels from 2 to -8.33 degrees a third of a degree apart, 32 from -8.83 to
/// -24.33 half a degree apart, 1.333 million points a second, 120 m, accuracy 2 cm; 50 m on pavement (10 %), beam 2
/// mrad wide.
LidarOptions hdl_64e() {
  LidarOptions options;
  SpinningPattern pattern;
  pattern.columns = 2083;
  pattern.elevations_deg = linspace(2.0, -25.0 / 3.0, 32);
  const std::vector<double> lower = linspace(-53.0 / 6.0, -73.0 / 3.0, 32);
  pattern.elevations_deg.insert(pattern.elevations_deg.end(), lower.begin(), lower.end());
  options.pattern = pattern;
  options.min_range_m = 0.9;
  options.max_range_m = 120.0;
  options.range_sigma_m = 0.02;
  options.divergence_rad = 2e-3;
  options.white_range_m = 50.0 / std::sqrt(0.1);
  return options;
}

/// Livox Mid-40 User Manual: a cone of 38.4 degrees, 100000 points a second, 260 m on 80 % reflectance, precision 2 cm,
/// beam 0.28 x 0.03 degrees. The prisms' speeds: Liu, Wang, Zhang, "Low-cost Retina-like Robotic Lidars Based on
/// Incommensurable Scanning", IEEE/ASME Transactions on Mechatronics 27(1), 2022.
LidarOptions livox_mid_40() {
  LidarOptions options;
  options.pattern = RosettePattern{};
  options.min_range_m = 1.0;
  options.max_range_m = 260.0;
  options.range_sigma_m = 0.02;
  options.divergence_rad = 0.28 * kRadiansPerDegree;
  options.white_range_m = 260.0 / std::sqrt(0.8);
  return options;
}

}  // namespace

void check(const LidarOptions& options) {
  check(options.pattern);
  base::require(options.min_range_m >= 0.0 && options.max_range_m > options.min_range_m, "lidar max_range",
                "must be more than min_range");
  base::require(options.range_sigma_m >= 0.0 && options.range_sigma_share >= 0.0, "lidar range_sigma",
                "must be 0 or more");
  base::require(options.divergence_rad >= 0.0 && options.divergence_rad < 1.0, "lidar divergence",
                "must be 0 to 1 rad");
  base::require(options.albedo_gain > 0.0, "lidar albedo_gain", "must be more than 0");
  base::require(options.intensity_reference_m > 0.0, "lidar intensity_reference", "must be more than 0");
  base::require(options.white_range_m > 0.0, "lidar white_range", "must be more than 0");
  base::require(options.signal_spread >= 0.0, "lidar signal_spread", "must be 0 or more");
  base::require(options.max_incidence_deg > 0.0, "lidar max_incidence", "must be more than 0");
  base::require(options.dropout_share >= 0.0 && options.dropout_share <= 1.0, "lidar dropout_share", "must be 0 to 1");
}

/// Camera z (forward) becomes lidar x, camera x (right) lidar -y, camera y (down) lidar -z.
SE3 LidarOptions::upright_on_camera() {
  geometry::Mat3 R_camera_lidar;
  R_camera_lidar << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return {R_camera_lidar, Vec3::Zero()};
}

LidarOptions lidar_preset(const std::string& name) {
  if (name == "vlp-16") return vlp_16();
  if (name == "os1-64") return os1_64();
  if (name == "hdl-64e") return hdl_64e();
  if (name == "livox-mid-40") return livox_mid_40();
  throw InputError("lidar '" + name + "'", "is unknown; use vlp-16, os1-64, hdl-64e or livox-mid-40");
}

/// Result of a beam.
struct Lidar::BeamReturn {
  bool returned = false;
  double range_m = 0.0;
  double intensity = 0.0;
};

namespace {

/// The scene with what moves in it, from one time to another; nullopt: nothing does.
std::optional<scene::Scene> with_placed(const scene::Scene& scene, const render::PlacedParts& placed, double from_s,
                                        double to_s) {
  if (!placed) return std::nullopt;
  return scene::Scene(scene.parts(), placed(from_s, to_s));
}

}  // namespace

Lidar::Lidar(const scene::Scene& scene, LidarOptions options, render::PlacedParts placed)
    : scene_(scene), options_(std::move(options)), placed_(std::move(placed)) {
  check(options_);
  const std::optional<scene::Scene> all = with_placed(scene_, placed_, 0.0, 0.0);
  appearance_ = std::make_shared<const render::Appearance>(all ? *all : scene_);
  if (is_periodic(options_.pattern)) beams_ = generate_beams(options_.pattern, 0);
}

Lidar::BeamReturn Lidar::trace_beam(const scene::Scene& scene, const LidarBeam& beam, std::uint64_t counter,
                                    const SE3& T_local_lidar, double time) const {
  const scene::Ray ray{T_local_lidar.translation, T_local_lidar.rotation * beam.direction, time};
  // Noise can bring surfaces slightly beyond the range into it.
  const double reach_m = options_.max_range_m * (1.0 + 6.0 * options_.range_sigma_share) + 6.0 * options_.range_sigma_m;
  const auto hit = scene.intersect(ray, reach_m);
  if (!hit) return {};
  const double cosine = std::abs(scene.normal(*hit).dot(ray.direction));
  const double albedo =
      std::min(1.0, options_.albedo_gain *
                        render::Reflectance(scene, *appearance_).at(*hit, options_.divergence_rad * hit->distance_m));
  const std::array<float, 4> n = base::normal_variates(base::stream_key(options_.seed, kLidarNoise), counter);
  const double distance_m = hit->distance_m, threshold = std::pow(distance_m / options_.white_range_m, 2);
  const bool lost = albedo * cosine * std::exp(options_.signal_spread * n[1]) < threshold ||
                    cosine < std::cos(options_.max_incidence_deg * kRadiansPerDegree) ||
                    uniform_number(base::stream_key(options_.seed, kDropoutStream), counter) < options_.dropout_share;
  const double range_m =
      distance_m + n[0] * std::hypot(options_.range_sigma_m, options_.range_sigma_share * distance_m);
  if (lost || range_m < options_.min_range_m || range_m > options_.max_range_m) return {};
  const double falls =
      options_.intensity_falls_with_range ? std::pow(options_.intensity_reference_m / distance_m, 2) : 1.0;
  return {true, range_m, std::min(1.0, albedo * cosine * falls)};
}

LidarScan Lidar::scan(std::uint64_t number, double start_s, const render::PoseFunction& T_local_camera_at) const {
  const std::vector<LidarBeam> own =
      beams_.empty() ? generate_beams(options_.pattern, number) : std::vector<LidarBeam>{};
  const std::vector<LidarBeam>& beams = beams_.empty() ? own : beams_;
  const SE3 T_local_start = T_local_camera_at(start_s) * options_.T_camera_lidar;
  const SE3 T_start_local = T_local_start.inverse();
  const std::uint64_t first_counter = base::splitmix64_hash(number);
  double duration_s = 0.0;
  for (const LidarBeam& beam : beams) duration_s = std::max(duration_s, static_cast<double>(beam.time_s));
  const std::optional<scene::Scene> own_scene = with_placed(scene_, placed_, start_s, start_s + duration_s);
  const scene::Scene& scene = own_scene ? *own_scene : scene_;
  const bool is_moving = duration_s > 0.0 && options_.motion != ScanMotion::kFrozen;
  std::vector<LidarPoint> points(beams.size());
  std::vector<char> returned(beams.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, beams.size(), 256), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const LidarBeam& beam = beams[i];
      const SE3 T_local_lidar = options_.motion == ScanMotion::kFrozen
                                    ? T_local_start
                                    : T_local_camera_at(start_s + beam.time_s) * options_.T_camera_lidar;
      const BeamReturn shot =
          trace_beam(scene, beam, first_counter + i, T_local_lidar, is_moving ? beam.time_s / duration_s : 0.0);
      returned[i] = shot.returned ? 1 : 0;
      const Vec3 own_frame = shot.range_m * beam.direction;
      const Vec3 position =
          options_.motion == ScanMotion::kCorrected ? T_start_local * (T_local_lidar * own_frame) : own_frame;
      points[i] = {position.cast<float>(), static_cast<float>(shot.intensity), static_cast<float>(beam.time_s),
                   beam.ring};
    }
  });
  LidarScan scan{start_s, T_local_start, {}, beams.size()};
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (returned[i] != 0) scan.points.push_back(points[i]);
  }
  return scan;
}

}  // namespace tileflight::sensors
