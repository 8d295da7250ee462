#pragma once

#include <array>

#include "tileflight/geometry/transform.h"

// The colours of the clear sky and of the sun behind it, in units of nature.
namespace tileflight::sensors {

/// Linear light in sRGB's primaries, scaled such that its luminance (ITU-R BT.709) is in kcd/m2 (light that comes from
/// a direction) or klx (light that falls on a surface). Never negative: what lies outside the primaries is cut off.
using DayLight = std::array<double, 3>;

double luminance(const DayLight& light);

/// CIE 1931 chromaticity and luminance.
struct SkyColor {
  double x = 0.0, y = 0.0;
  double luminance_kcd_m2 = 0.0;
};

/// The turbidities (thickness of the whole air against that of pure air) that the sky's formulas hold for: 2 is very
/// clear, 3 clear, 6 hazy.
inline constexpr double kLeastTurbidity = 2.0, kLargestTurbidity = 10.0;

/// Of the zenith, the sun being `sun_zenith_rad` away from it: Preetham, Shirley and Smits, "A practical analytic model
/// for daylight", SIGGRAPH 1999, appendix A.2.
SkyColor zenith_color(double sun_zenith_rad, double turbidity);

/// A clear sky after Preetham, Shirley and Smits: the zenith's colour times Perez' five-parameter formula, whose
/// parameters are linear in the turbidity.
class Sky {
 public:
  /// `toward_sun`: unit, east north up, not below the horizon.
  Sky(const geometry::Vec3& toward_sun, double turbidity);

  /// In a unit direction; below the horizon that of the horizon.
  SkyColor color(const geometry::Vec3& direction) const;
  DayLight radiance(const geometry::Vec3& direction) const;

 private:
  struct Perez {
    double a, b, c, d, e;
    double at(double cos_zenith, double gamma_rad) const;
  };
  static std::array<Perez, 3> parameters(double turbidity);

  geometry::Vec3 toward_sun_;
  std::array<Perez, 3> perez_;   ///< of x, y and luminance
  std::array<double, 3> scale_;  ///< zenith's value over the formula's there
};

/// What the sun's rays bring to a surface across them at the bottom of the air, klx: a black body of 5772 K with the
/// illuminance of the solar constant (133.3 klx at 1 astronomical unit), dimmed by air molecules and dust (the optical
/// depths of Preetham et al., appendix A.1, after Iqbal 1983 and Angstrom; ozone and water vapour left out) along the
/// air mass of Kasten and Young (Applied Optics 28, 1989).
DayLight sun_illuminance(double elevation_rad, double distance_au, double turbidity, double pressure_hpa);

/// How many times more air the rays of a sun at this apparent elevation pass than from the zenith.
double air_mass(double elevation_rad);

}  // namespace tileflight::sensors
