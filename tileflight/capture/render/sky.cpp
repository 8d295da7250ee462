#include "tileflight/capture/render/sky.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::render {
namespace {

using geometry::Vec3;

/// IEC 61966-2-1.
PhotometricRgb srgb_from_xyz(double x, double y, double z) {
  return {std::max(0.0, 3.2406 * x - 1.5372 * y - 0.4986 * z), std::max(0.0, -0.9689 * x + 1.8758 * y + 0.0415 * z),
          std::max(0.0, 0.0557 * x - 0.2040 * y + 1.0570 * z)};
}

/// (T^2, T, 1) M (t^3, t^2, t, 1).
double chromaticity(const std::array<std::array<double, 4>, 3>& m, double t, double turbidity) {
  const auto row = [t](const std::array<double, 4>& r) { return ((r[0] * t + r[1]) * t + r[2]) * t + r[3]; };
  return (row(m[0]) * turbidity + row(m[1])) * turbidity + row(m[2]);
}

/// Wyman, Sloan and Shirley, "Simple analytic approximations to the CIE XYZ color matching functions", JCGT 2(2), 2013:
/// one asymmetric Gaussian lobe. Wavelengths in nm.
double lobe(double wavelength, double height, double mean, double sigma_below, double sigma_above) {
  const double t = (wavelength - mean) / (wavelength < mean ? sigma_below : sigma_above);
  return height * std::exp(-0.5 * t * t);
}

std::array<double, 3> color_matching(double w) {
  return {lobe(w, 1.056, 599.8, 37.9, 31.0) + lobe(w, 0.362, 442.0, 16.0, 26.7) + lobe(w, -0.065, 501.1, 20.4, 26.2),
          lobe(w, 0.821, 568.8, 46.9, 40.5) + lobe(w, 0.286, 530.9, 16.3, 31.1),
          lobe(w, 1.217, 437.0, 11.8, 36.0) + lobe(w, 0.681, 459.0, 26.0, 13.8)};
}

/// Planck's law up to a constant factor, of the sun's effective temperature (IAU 2015).
double sun_spectrum(double wavelength_um) {
  constexpr double kSecondRadiation_um_k = 14387.77, kSun_k = 5772.0;
  return 1.0 / (std::pow(wavelength_um, 5) * (std::exp(kSecondRadiation_um_k / (wavelength_um * kSun_k)) - 1.0));
}

/// Transmittance of the atmosphere at one wavelength.
double transmittance(double wavelength_um, double air_mass, double turbidity, double pressure_hpa) {
  const double molecules = 0.008735 * std::pow(wavelength_um, -4.08) * pressure_hpa / 1013.25;
  const double dust = (0.04608 * turbidity - 0.04586) * std::pow(wavelength_um, -1.3);
  return std::exp(-air_mass * (molecules + dust));
}

}  // namespace

double luminance(const PhotometricRgb& light) { return 0.2126 * light[0] + 0.7152 * light[1] + 0.0722 * light[2]; }

SkyColor zenith_color(double sun_zenith_rad, double turbidity) {
  const double chi = (4.0 / 9.0 - turbidity / 120.0) * (std::numbers::pi - 2.0 * sun_zenith_rad);
  return {chromaticity({{{0.00166, -0.00375, 0.00209, 0.0},
                         {-0.02903, 0.06377, -0.03202, 0.00394},
                         {0.11693, -0.21196, 0.06052, 0.25886}}},
                       sun_zenith_rad, turbidity),
          chromaticity({{{0.00275, -0.00610, 0.00317, 0.0},
                         {-0.04214, 0.08970, -0.04153, 0.00516},
                         {0.15346, -0.26756, 0.06670, 0.26688}}},
                       sun_zenith_rad, turbidity),
          (4.0453 * turbidity - 4.9710) * std::tan(chi) - 0.2155 * turbidity + 2.4192};
}

/// Equation (3); at the horizon its limit is used.
double Sky::Perez::evaluate(double cos_zenith, double gamma_rad) const {
  const double cosine = std::cos(gamma_rad);
  return (1.0 + a * std::exp(b / std::max(cos_zenith, 1e-4))) *
         (1.0 + c * std::exp(d * gamma_rad) + e * cosine * cosine);
}

std::array<Sky::Perez, 3> Sky::parameters(double t) {
  return {
      {{-0.0193 * t - 0.2592, -0.0665 * t + 0.0008, -0.0004 * t + 0.2125, -0.0641 * t - 0.8989, -0.0033 * t + 0.0452},
       {-0.0167 * t - 0.2608, -0.0950 * t + 0.0092, -0.0079 * t + 0.2102, -0.0441 * t - 1.6537, -0.0109 * t + 0.0529},
       {0.1787 * t - 1.4630, -0.3554 * t + 0.4275, -0.0227 * t + 5.3251, 0.1206 * t - 2.5771, -0.0670 * t + 0.3703}}};
}

Sky::Sky(const Vec3& toward_sun, double turbidity) : toward_sun_(toward_sun), perez_(parameters(turbidity)) {
  const double sun_zenith_rad = std::acos(std::clamp(toward_sun.z(), 0.0, 1.0));
  const SkyColor zenith = zenith_color(sun_zenith_rad, turbidity);
  scale_ = {zenith.x, zenith.y, zenith.luminance_kcd_m2};
  for (std::size_t i = 0; i < scale_.size(); ++i) scale_[i] /= perez_[i].evaluate(1.0, sun_zenith_rad);
}

SkyColor Sky::color(const Vec3& direction) const {
  const double gamma_rad = std::acos(std::clamp(direction.dot(toward_sun_), -1.0, 1.0));
  const auto value = [&](std::size_t i) { return scale_[i] * perez_[i].evaluate(direction.z(), gamma_rad); };
  return {value(0), value(1), value(2)};
}

PhotometricRgb Sky::radiance(const Vec3& direction) const {
  const SkyColor color = this->color(direction);
  const double scale = color.luminance_kcd_m2 / color.y;
  return srgb_from_xyz(color.x * scale, color.luminance_kcd_m2, (1.0 - color.x - color.y) * scale);
}

double air_mass(double elevation_rad) {
  const double degrees = std::max(0.0, elevation_rad * 180.0 / std::numbers::pi);
  return 1.0 / (std::sin(degrees * std::numbers::pi / 180.0) + 0.50572 * std::pow(degrees + 6.07995, -1.6364));
}

PhotometricRgb sun_illuminance(double elevation_rad, double distance_au, double turbidity, double pressure_hpa) {
  constexpr double kSolarConstant_klx = 133.3;
  constexpr double kFirst_nm = 380.0, kLast_nm = 780.0, kStep_nm = 5.0;
  const double mass = air_mass(elevation_rad);
  std::array<double, 3> xyz{};
  double y_outside = 0.0;
  for (double nm = kFirst_nm; nm <= kLast_nm; nm += kStep_nm) {
    const std::array<double, 3> matching = color_matching(nm);
    const double power = sun_spectrum(1e-3 * nm);
    const double left = power * transmittance(1e-3 * nm, mass, turbidity, pressure_hpa);
    y_outside += power * matching[1];
    for (std::size_t c = 0; c < 3; ++c) xyz[c] += left * matching[c];
  }
  const double klx = kSolarConstant_klx / (y_outside * distance_au * distance_au);
  return srgb_from_xyz(klx * xyz[0], klx * xyz[1], klx * xyz[2]);
}

}  // namespace tileflight::render
