#include "tileflight/capture/render/daylight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::render {
namespace {

using geometry::Vec3;

constexpr double kPi = std::numbers::pi;
constexpr double kDegrees = 180.0 / kPi;

/// A patch of sky.
struct SkyPatch {
  Vec3 direction;
  PhotometricRgb light;  ///< radiance times solid angle
};

/// Rings of equal height, divided into cells of equal width.
std::vector<SkyPatch> sky_patches(const Sky& sky) {
  constexpr int kRings = 48, kSectors = 96;
  std::vector<SkyPatch> patches;
  for (int ring = 0; ring < kRings; ++ring) {
    const double low = 0.5 * kPi * ring / kRings, high = 0.5 * kPi * (ring + 1) / kRings, middle = 0.5 * (low + high);
    const double solid_angle = (std::sin(high) - std::sin(low)) * 2.0 * kPi / kSectors;
    for (int sector = 0; sector < kSectors; ++sector) {
      const double azimuth = 2.0 * kPi * (sector + 0.5) / kSectors;
      const Vec3 direction(std::cos(middle) * std::sin(azimuth), std::cos(middle) * std::cos(azimuth),
                           std::sin(middle));
      PhotometricRgb light = sky.radiance(direction);
      for (double& channel : light) channel *= solid_angle;
      patches.push_back({direction, light});
    }
  }
  return patches;
}

PhotometricRgb illuminance(const std::vector<SkyPatch>& patches, const Vec3& normal) {
  PhotometricRgb sum{};
  for (const SkyPatch& patch : patches) {
    const double cosine = std::max(0.0, patch.direction.dot(normal));
    for (std::size_t c = 0; c < 3; ++c) sum[c] += cosine * patch.light[c];
  }
  return sum;
}

// Octahedral map: the unit normals projected to |x| + |y| + |z| = 1, whose lower half is unfolded outwards (Meyer et
// al., "On floating-point normal vectors", EGSR 2010). Nodes lie on the square's border, so that no wrapping is needed.
constexpr int kDiffuseNodes = 33;

Vec3 octahedral_normal(double u, double v) {
  Vec3 n(u, v, 1.0 - std::abs(u) - std::abs(v));
  if (n.z() < 0.0) {
    const double x = n.x();
    n.x() = std::copysign(1.0 - std::abs(n.y()), x);
    n.y() = std::copysign(1.0 - std::abs(x), n.y());
  }
  return n.normalized();
}

/// A table cell and the position within it.
struct Cell {
  int index;
  float share;
};

Cell cell_of(float position, int cells) {
  const int index = std::clamp(static_cast<int>(position), 0, cells - 1);
  return {index, position - static_cast<float>(index)};
}

LinearRgb interpolate(const LinearRgb& a, const LinearRgb& b, float share) {
  return {a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])};
}

constexpr int kHorizonCells = 256;

const DaylightOptions& checked(const DaylightOptions& settings) {
  validate_daylight_options(settings);
  if (!settings.utc_s) throw InputError("light", "has no time; give one, e.g. `time: 2024-03-20T17:00:00Z`");
  return settings;
}

/// Moves the sun's direction to the horizon.
SunPosition sun_on_horizon(SunPosition sun) {
  sun.direction = {std::sin(sun.azimuth_rad), std::cos(sun.azimuth_rad), 0.0};
  return sun;
}

SunPosition require_risen_sun(const DaylightOptions& settings, const geometry::Geodetic& origin) {
  const SunPosition sun = sun_position(*checked(settings).utc_s, origin, standard_air(origin.height.m));
  if (sun.elevation_rad > 0.0) return sun;
  if (settings.allows_night) return sun_on_horizon(sun);
  const std::string place = base::formatted("latitude %.4f, longitude %.4f", origin.latitude_deg, origin.longitude_deg);
  throw InputError("light", base::formatted("the sun is %.1f degrees below the horizon at that time",
                                            -sun.elevation_rad * kDegrees) +
                                " at " + place + "; give a daytime, in UTC or with its UTC offset");
}

std::array<float, 3> as_floats(const Vec3& v) {
  return {static_cast<float>(v.x()), static_cast<float>(v.y()), static_cast<float>(v.z())};
}

/// Image units per klx, such that `level` (the illuminance of level ground) gives white.
PhotometricRgb picture_units(const DaylightOptions& settings, const PhotometricRgb& level) {
  const double gain = std::exp2(settings.exposure_stops);
  if (settings.white_balance == WhiteBalance::kDaylight) {
    const double scale = gain / luminance(level);
    return {scale, scale, scale};
  }
  PhotometricRgb units{};
  // A nearly absent red or blue cannot be restored.
  for (std::size_t c = 0; c < 3; ++c) units[c] = gain / std::max(level[c], 0.02 * luminance(level));
  return units;
}

}  // namespace

void validate_daylight_options(const DaylightOptions& s) {
  base::require(s.turbidity >= kMinTurbidity && s.turbidity <= kMaxTurbidity, "light: turbidity",
                "must lie between 2 (very clear air) and 10");
  base::require(s.ground_albedo >= 0.0 && s.ground_albedo <= 1.0, "light: ground albedo", "must lie between 0 and 1");
  base::require(std::abs(s.exposure_stops) <= 20.0, "light: exposure", "must lie between -20 and 20 stops");
}

double twilight_dimming(double sun_elevation_rad) {
  constexpr double kDarkest = 1.0 / 64.0, kLogAtHorizon = 2.88;  // of lux
  const double degrees = sun_elevation_rad * kDegrees, x = degrees / 90.0;
  if (degrees >= 0.0) return 1.0;
  const auto dimmed = [&](double a, double b, double c, double d) {
    return std::max(kDarkest, std::pow(10.0, a + x * (b + x * (c + x * d)) - kLogAtHorizon));
  };
  if (degrees > -0.8) return dimmed(2.88, 22.26, -207.64, 1034.30);
  if (degrees > -5.0) return dimmed(2.88, 21.81, -258.11, -858.36);
  return kDarkest;
}

PhotometricRgb sky_illuminance(const Sky& sky, const Vec3& normal) { return illuminance(sky_patches(sky), normal); }

DaylightOptions relief_light() {
  DaylightOptions light;
  light.utc_s = 1709043240.0;  // 2024-02-27T14:14:00Z, when it stands there at 45 degrees south
  light.place = geometry::Geodetic{-45.0, 0.0, {0.0}};
  light.exposure_stops = -0.7;  // surfaces are white where nothing else is said: what faces the sun stays below 255
  light.casts_shadows = false;
  return light;
}

std::shared_ptr<const Daylight> make_daylight(const DaylightOptions& settings,
                                              const std::optional<geometry::Geodetic>& origin) {
  if (settings.place) return std::make_shared<const Daylight>(settings, *settings.place);
  if (origin) return std::make_shared<const Daylight>(settings, *origin);
  throw InputError(
      "light",
      "the place is not georeferenced, so the sun's position is unknown; give an origin (latitude, longitude, height)");
}

Daylight::Daylight(const DaylightOptions& settings, const geometry::Geodetic& origin)
    : sun_(require_risen_sun(settings, origin)),
      casts_shadows_(settings.casts_shadows),
      toward_sun_(as_floats(sun_.direction)),
      sky_(sun_.direction, settings.turbidity) {
  PhotometricRgb sun{};
  if (sun_.elevation_rad > 0.0)
    sun = sun_illuminance(sun_.elevation_rad, sun_.distance_au, settings.turbidity,
                          standard_air(origin.height.m).pressure_hpa);
  PhotometricRgb level_sun = sun, level = sky_illuminance(sky_, Vec3::UnitZ());
  for (std::size_t c = 0; c < 3; ++c) level_sun[c] *= sun_.direction.z(), level[c] += level_sun[c];
  picture_per_klx_ = picture_units(settings, level);
  for (double& unit : picture_per_klx_) unit *= twilight_dimming(sun_.elevation_rad);
  sunlight_ = to_picture_units(sun);
  build_diffuse_table(settings.ground_albedo, level);
  build_horizon_table();
}

LinearRgb Daylight::to_picture_units(const PhotometricRgb& light) const {
  LinearRgb result;
  for (std::size_t c = 0; c < 3; ++c) result[c] = static_cast<float>(light[c] * picture_per_klx_[c]);
  return result;
}

/// Light of the sky from above, and from below of the ground lit by sun and sky, which fills (1 - n.z) / 2 of the
/// hemisphere.
void Daylight::build_diffuse_table(double ground_albedo, const PhotometricRgb& level) {
  const std::vector<SkyPatch> patches = sky_patches(sky_);
  for (int row = 0; row < kDiffuseNodes; ++row) {
    for (int column = 0; column < kDiffuseNodes; ++column) {
      constexpr double kStep = 2.0 / (kDiffuseNodes - 1);
      const Vec3 normal = octahedral_normal(-1.0 + kStep * column, -1.0 + kStep * row);
      PhotometricRgb light = illuminance(patches, normal);
      for (std::size_t c = 0; c < 3; ++c) light[c] += ground_albedo * 0.5 * (1.0 - normal.z()) * level[c];
      diffuse_.push_back(to_picture_units(light));
    }
  }
}

void Daylight::build_horizon_table() {
  for (int i = 0; i <= kHorizonCells; ++i) {
    const double azimuth = 2.0 * kPi * i / kHorizonCells - kPi;
    PhotometricRgb light = sky_.radiance({std::sin(azimuth), std::cos(azimuth), 0.0});
    for (double& channel : light) channel *= kPi;  // a white surface under a uniform sky of this radiance
    horizon_.push_back(to_picture_units(light));
  }
}

LinearRgb Daylight::diffuse(const std::array<float, 3>& n) const {
  const float scale = 1.0F / (std::abs(n[0]) + std::abs(n[1]) + std::abs(n[2]));
  float u = n[0] * scale, v = n[1] * scale;
  if (n[2] < 0.0F) {
    const float x = u;
    u = std::copysign(1.0F - std::abs(v), x);
    v = std::copysign(1.0F - std::abs(x), v);
  }
  constexpr float kCells = kDiffuseNodes - 1;
  const Cell column = cell_of(0.5F * (u + 1.0F) * kCells, kDiffuseNodes - 1);
  const Cell row = cell_of(0.5F * (v + 1.0F) * kCells, kDiffuseNodes - 1);
  const LinearRgb* node = &diffuse_[static_cast<std::size_t>(row.index * kDiffuseNodes + column.index)];
  return interpolate(interpolate(node[0], node[1], column.share),
                     interpolate(node[kDiffuseNodes], node[kDiffuseNodes + 1], column.share), row.share);
}

LinearRgb Daylight::horizon(const std::array<float, 3>& direction) const {
  constexpr float kTurns = 0.5F / std::numbers::pi_v<float>;
  const Cell cell = cell_of((std::atan2(direction[0], direction[1]) * kTurns + 0.5F) * kHorizonCells, kHorizonCells);
  const LinearRgb* node = &horizon_[static_cast<std::size_t>(cell.index)];
  return interpolate(node[0], node[1], cell.share);
}

LinearRgb Daylight::sky(const std::array<float, 3>& d) const {
  if (d[2] <= 0.0F) return horizon(d);
  constexpr float kCosOfRadius = 0.99998917F;  // cosine of 0.2667 degrees
  if (sun_.elevation_rad > 0.0 &&
      d[0] * toward_sun_[0] + d[1] * toward_sun_[1] + d[2] * toward_sun_[2] > kCosOfRadius) {
    LinearRgb disc = sunlight_;
    const float largest = std::max({disc[0], disc[1], disc[2]});
    for (float& channel : disc) channel *= kDiscWhites / largest;
    return disc;
  }
  PhotometricRgb light = sky_.radiance(Vec3(d[0], d[1], d[2]));
  for (double& channel : light) channel *= kPi;
  return to_picture_units(light);
}

std::string describe_sun_position(const SunPosition& sun) {
  return base::formatted("sun %.1f degrees high, azimuth %.1f degrees", sun.elevation_rad * kDegrees,
                         sun.azimuth_rad * kDegrees);
}

}  // namespace tileflight::render
