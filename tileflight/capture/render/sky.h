#pragma once

#include <array>

#include "tileflight/core/geometry/transform.h"

// Colours of the clear sky and of the sun, in physical units.
namespace tileflight::render {

/// Linear light in sRGB primaries, scaled so that its luminance (ITU-R BT.709) is in kcd/m2 (from a direction) or klx
/// (on a surface). Never negative: colours outside the gamut are clipped.
using PhotometricRgb = std::array<double, 3>;

double luminance(const PhotometricRgb& light);

/// CIE 1931 chromaticity and luminance.
struct SkyColor {
  double x = 0.0, y = 0.0;
  double luminance_kcd_m2 = 0.0;
};

/// Range of turbidity (optical thickness of the whole air relative to that of pure air) for which the sky model is
/// valid: 2 is very clear, 3 clear, 6 hazy.
inline constexpr double kMinTurbidity = 2.0, kMaxTurbidity = 10.0;

/// Computes the colour of the zenith for a sun at the zenith angle `sun_zenith_rad`: Preetham, Shirley and Smits, "A
/// practical analytic model for daylight", SIGGRAPH 1999, appendix A.2.
SkyColor zenith_color(double sun_zenith_rad, double turbidity);

/// Clear sky model of Preetham, Shirley and Smits: the zenith's colour times Perez' five-parameter formula, whose
/// parameters are linear in the turbidity.
class Sky {
 public:
  /// `toward_sun`: unit, east north up, not below the horizon.
  Sky(const geometry::Vec3& toward_sun, double turbidity);

  /// Returns the sky's colour in a unit direction; below the horizon, that of the horizon.
  SkyColor color(const geometry::Vec3& direction) const;
  PhotometricRgb radiance(const geometry::Vec3& direction) const;

 private:
  struct Perez {
    double a, b, c, d, e;
    double evaluate(double cos_zenith, double gamma_rad) const;
  };
  static std::array<Perez, 3> parameters(double turbidity);

  geometry::Vec3 toward_sun_;
  std::array<Perez, 3> perez_;   ///< of x, y and luminance
  std::array<double, 3> scale_;  ///< zenith's value divided by the formula's value at the zenith
};

/// Computes the illuminance by the sun on a surface perpendicular to its rays at ground level, klx: a black body of
/// 5772 K with the illuminance of the solar constant (133.3 klx at 1 astronomical unit), attenuated by air molecules
/// and dust (the optical depths of Preetham et al., appendix A.1, after Iqbal 1983 and Angstrom; without ozone and
/// water vapour) along the air mass of Kasten and Young (Applied Optics 28, 1989).
PhotometricRgb sun_illuminance(double elevation_rad, double distance_au, double turbidity, double pressure_hpa);

/// Computes the relative air mass (1 at the zenith) for a sun at this apparent elevation.
double air_mass(double elevation_rad);

}  // namespace tileflight::render
