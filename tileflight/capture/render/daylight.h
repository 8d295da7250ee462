#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/capture/render/sky.h"
#include "tileflight/capture/render/solar_position.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::render {

/// White balance of the camera.
enum class WhiteBalance {
  kLevelGround,  ///< a level white surface in full light is white, as with automatic white balance
  kDaylight,     ///< fixed at D65: a low sun is yellow
};

/// Light by sun and sky instead of the light baked into the textures.
struct DaylightOptions {
  std::optional<double> utc_s;  ///< seconds since 1970 in UTC; required
  double turbidity = 3.0;       ///< of the air: 2 (very clear) to 10 (hazy)
  double ground_albedo = 0.2;   ///< fraction of light that the ground reflects upwards, 0..1
  double exposure_stops = 0.0;  ///< brightness change in stops (factors of two)
  WhiteBalance white_balance = WhiteBalance::kLevelGround;
  /// With the sun below the horizon: the sky of a sun on the horizon, dimmed as twilight is (twilight_dimming).
  /// Default: that is an error.
  bool allows_night = false;
  bool casts_shadows = true;                  ///< false: light depends on a surface's direction alone
  std::optional<geometry::Geodetic> place{};  ///< where the sun is seen from; default: the origin of the local frame
};

/// Returns the light by which a place without textures is shown: the same everywhere, a sun 45 degrees high in the
/// north-west as in shaded relief maps. It depends on the direction of surfaces alone, so that no tile outside of the
/// image matters.
DaylightOptions relief_light();

/// Returns the light of the sky with the sun below the horizon, relative to that with the sun on it: the polynomials of
/// the "Explanatory Supplement to the Astronomical Almanac" (Seidelmann 1992, section 9.32), but at least 1/64, as a
/// camera's exposure follows. 1 with the sun above.
double twilight_dimming(double sun_elevation_rad);

/// Throws InputError (option, cause) if a value is out of range. The time may be missing here.
void validate_daylight_options(const DaylightOptions& settings);

/// The light at one place and time, in image units: 1 is the light reflected by a level white surface in full light, so
/// that a level surface looks like its texture. Surfaces are matt (Lambert). Immutable.
class Daylight {
 public:
  /// `origin`: of the local frame. Throws InputError for settings out of range, a missing time, and a sun below the
  /// horizon (unless night is allowed), stating its position: the sky model is valid only by day.
  Daylight(const DaylightOptions& settings, const geometry::Geodetic& origin);

  const SunPosition& sun() const { return sun_; }
  bool casts_shadows() const { return casts_shadows_; }
  /// Unit vector towards the sun.
  const std::array<float, 3>& toward_sun() const { return toward_sun_; }
  /// Returns the light reflected by a white surface perpendicular to the sun's rays.
  const LinearRgb& sunlight() const { return sunlight_; }
  /// Returns the light of sky and ground reflected by a white surface with this unit normal. From a table; error at
  /// most 1 %.
  LinearRgb diffuse(const std::array<float, 3>& normal) const;
  /// Returns the radiance of the sky in a unit direction, including the sun's disc (limited to kDiscWhites); below the
  /// horizon, that of the horizon.
  LinearRgb sky(const std::array<float, 3>& direction) const;
  /// Returns the radiance of the sky just above the horizon, at the azimuth of a direction.
  LinearRgb horizon(const std::array<float, 3>& direction) const;

  /// Limit of the disc's brightness: the real one is thousands of times brighter than anything else; this is enough to
  /// appear white, and keeps the automatic exposure realistic, as real meters saturate.
  static constexpr float kDiscWhites = 30.0F;

 private:
  void build_diffuse_table(double ground_albedo, const PhotometricRgb& level);
  void build_horizon_table();
  LinearRgb to_picture_units(const PhotometricRgb& light) const;

  SunPosition sun_;
  bool casts_shadows_ = true;
  std::array<float, 3> toward_sun_{};
  Sky sky_;
  PhotometricRgb picture_per_klx_{};  ///< converts klx on a white surface to image units
  LinearRgb sunlight_{};
  std::vector<LinearRgb> diffuse_;  ///< table over the unfolded surface of an octahedron, row by row
  std::vector<LinearRgb> horizon_;  ///< evenly spaced in azimuth, the first repeated at the end
};

/// Throws InputError if neither the settings nor the local frame's origin tell where the sun is seen from.
std::shared_ptr<const Daylight> make_daylight(const DaylightOptions& settings,
                                              const std::optional<geometry::Geodetic>& origin);

/// Computes the illuminance of a surface with this unit normal by the sky alone, klx: the integral over the sky above
/// it.
PhotometricRgb sky_illuminance(const Sky& sky, const geometry::Vec3& normal);

/// Describes the position in words: "sun 54.9 degrees high, azimuth 181.2 degrees".
std::string describe_sun_position(const SunPosition& sun);

}  // namespace tileflight::render
