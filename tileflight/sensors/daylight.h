#pragma once

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/sensors/light.h"
#include "tileflight/sensors/sky.h"
#include "tileflight/sensors/solar_position.h"

namespace tileflight::sensors {

/// Which surface the camera takes for white.
enum class WhiteBalance {
  kLevelGround,  ///< a level white surface in full light is white, as an automatic balance has it
  kDaylight,     ///< fixed at D65: a low sun is yellow
};

/// Light by sun and sky instead of what is baked into the textures.
struct SunAndSky {
  std::optional<double> utc_s;  ///< seconds since 1970 in UTC; needed
  double turbidity = 3.0;       ///< of the air: 2 very clear to 10 thick
  double ground_albedo = 0.2;   ///< of what throws light back up, 0..1
  double exposure_stops = 0.0;  ///< brighter by so many doublings
  WhiteBalance white_balance = WhiteBalance::kLevelGround;
};

/// Throws InputError (option, cause) where a value is out of its range. The time may be missing here.
void check_light(const SunAndSky& settings);

/// The light of one place and moment, in the picture's units: 1 is what a level white surface gives back in full light,
/// so that a level surface looks just as its texture says. Surfaces are matt (Lambert). Immutable.
class Daylight {
 public:
  /// `origin`: of the local frame. Throws InputError for settings out of range, without a time, and for a sun below the
  /// horizon, naming where it stands: the sky's formulas are for the day.
  Daylight(const SunAndSky& settings, const geometry::Geodetic& origin);

  const SunPosition& sun() const { return sun_; }
  /// Unit, towards the sun.
  const std::array<float, 3>& toward_sun() const { return toward_sun_; }
  /// What a white surface across the sun's rays gives back of them.
  const Light& sunlight() const { return sunlight_; }
  /// What a white surface gives back of the light of the sky and of the ground, by its unit normal. From a table; 1 %
  /// off at most.
  Light diffuse(const std::array<float, 3>& normal) const;
  /// The sky in a unit direction, the sun's disc included (cut off at kDiscWhites); below the horizon that of the
  /// horizon.
  Light sky(const std::array<float, 3>& direction) const;
  /// The sky just above the horizon, by the azimuth of a direction.
  Light horizon(const std::array<float, 3>& direction) const;

  /// The sun's disc is thousands of times brighter than anything else; a few times is enough to be white and to leave
  /// the automatic exposure as real meters are, which are saturated by it.
  static constexpr float kDiscWhites = 30.0F;

 private:
  void fill_diffuse(double ground_albedo, const DayLight& level);
  void fill_horizon();
  Light in_picture(const DayLight& light) const;

  SunPosition sun_;
  std::array<float, 3> toward_sun_{};
  Sky sky_;
  DayLight picture_per_klx_{};  ///< picture units of a white surface's light for each klx on it
  Light sunlight_{};
  std::vector<Light> diffuse_;  ///< over an octahedron's unfolded surface, row by row
  std::vector<Light> horizon_;  ///< evenly by azimuth, the first repeated at the end
};

/// Throws InputError where no place on the earth is known.
std::shared_ptr<const Daylight> daylight_at(const SunAndSky& settings, const std::optional<geometry::Geodetic>& origin);

/// What falls on a surface of this unit normal from the sky alone, klx: the sum over the sky's directions above it.
DayLight sky_illuminance(const Sky& sky, const geometry::Vec3& normal);

/// "sun 54.9 degrees high, azimuth 181.2 degrees".
std::string described(const SunPosition& sun);

}  // namespace tileflight::sensors
