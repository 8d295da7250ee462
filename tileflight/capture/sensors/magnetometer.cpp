#include "tileflight/capture/sensors/magnetometer.h"

#include <GeographicLib/SphericalHarmonic.hpp>
#include <cmath>
#include <vector>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::sensors {

namespace {

using geometry::Vec3;

using geometry::kRadiansPerDegree;
constexpr double kMicroPerNano = 1e-3;
constexpr double kEpoch = 2025.0, kEnd = 2030.0;
constexpr double kReferenceRadius_m = 6371200.0;
constexpr int kDegree = 12;

/// Gauss coefficients of degree n and order m at the epoch, nanotesla, and their change per year.
struct GaussCoefficients {
  int n, m;
  double g, h, g_rate, h_rate;
};

// WMM2025.COF of 13 November 2024.
constexpr GaussCoefficients kTerms[] = {{1, 0, -29351.8, 0, 12, 0},
                                        {1, 1, -1410.8, 4545.4, 9.7, -21.5},
                                        {2, 0, -2556.6, 0, -11.6, 0},
                                        {2, 1, 2951.1, -3133.6, -5.2, -27.7},
                                        {2, 2, 1649.3, -815.1, -8, -12.1},
                                        {3, 0, 1361, 0, -1.3, 0},
                                        {3, 1, -2404.1, -56.6, -4.2, 4},
                                        {3, 2, 1243.8, 237.5, 0.4, -0.3},
                                        {3, 3, 453.6, -549.5, -15.6, -4.1},
                                        {4, 0, 895, 0, -1.6, 0},
                                        {4, 1, 799.5, 278.6, -2.4, -1.1},
                                        {4, 2, 55.7, -133.9, -6, 4.1},
                                        {4, 3, -281.1, 212, 5.6, 1.6},
                                        {4, 4, 12.1, -375.6, -7, -4.4},
                                        {5, 0, -233.2, 0, 0.6, 0},
                                        {5, 1, 368.9, 45.4, 1.4, -0.5},
                                        {5, 2, 187.2, 220.2, 0, 2.2},
                                        {5, 3, -138.7, -122.9, 0.6, 0.4},
                                        {5, 4, -142, 43, 2.2, 1.7},
                                        {5, 5, 20.9, 106.1, 0.9, 1.9},
                                        {6, 0, 64.4, 0, -0.2, 0},
                                        {6, 1, 63.8, -18.4, -0.4, 0.3},
                                        {6, 2, 76.9, 16.8, 0.9, -1.6},
                                        {6, 3, -115.7, 48.8, 1.2, -0.4},
                                        {6, 4, -40.9, -59.8, -0.9, 0.9},
                                        {6, 5, 14.9, 10.9, 0.3, 0.7},
                                        {6, 6, -60.7, 72.7, 0.9, 0.9},
                                        {7, 0, 79.5, 0, 0, 0},
                                        {7, 1, -77, -48.9, -0.1, 0.6},
                                        {7, 2, -8.8, -14.4, -0.1, 0.5},
                                        {7, 3, 59.3, -1, 0.5, -0.8},
                                        {7, 4, 15.8, 23.4, -0.1, 0},
                                        {7, 5, 2.5, -7.4, -0.8, -1},
                                        {7, 6, -11.1, -25.1, -0.8, 0.6},
                                        {7, 7, 14.2, -2.3, 0.8, -0.2},
                                        {8, 0, 23.2, 0, -0.1, 0},
                                        {8, 1, 10.8, 7.1, 0.2, -0.2},
                                        {8, 2, -17.5, -12.6, 0, 0.5},
                                        {8, 3, 2, 11.4, 0.5, -0.4},
                                        {8, 4, -21.7, -9.7, -0.1, 0.4},
                                        {8, 5, 16.9, 12.7, 0.3, -0.5},
                                        {8, 6, 15, 0.7, 0.2, -0.6},
                                        {8, 7, -16.8, -5.2, 0, 0.3},
                                        {8, 8, 0.9, 3.9, 0.2, 0.2},
                                        {9, 0, 4.6, 0, 0, 0},
                                        {9, 1, 7.8, -24.8, -0.1, -0.3},
                                        {9, 2, 3, 12.2, 0.1, 0.3},
                                        {9, 3, -0.2, 8.3, 0.3, -0.3},
                                        {9, 4, -2.5, -3.3, -0.3, 0.3},
                                        {9, 5, -13.1, -5.2, 0, 0.2},
                                        {9, 6, 2.4, 7.2, 0.3, -0.1},
                                        {9, 7, 8.6, -0.6, -0.1, -0.2},
                                        {9, 8, -8.7, 0.8, 0.1, 0.4},
                                        {9, 9, -12.9, 10, -0.1, 0.1},
                                        {10, 0, -1.3, 0, 0.1, 0},
                                        {10, 1, -6.4, 3.3, 0, 0},
                                        {10, 2, 0.2, 0, 0.1, 0},
                                        {10, 3, 2, 2.4, 0.1, -0.2},
                                        {10, 4, -1, 5.3, 0, 0.1},
                                        {10, 5, -0.6, -9.1, -0.3, -0.1},
                                        {10, 6, -0.9, 0.4, 0, 0.1},
                                        {10, 7, 1.5, -4.2, -0.1, 0},
                                        {10, 8, 0.9, -3.8, -0.1, -0.1},
                                        {10, 9, -2.7, 0.9, 0, 0.2},
                                        {10, 10, -3.9, -9.1, 0, 0},
                                        {11, 0, 2.9, 0, 0, 0},
                                        {11, 1, -1.5, 0, 0, 0},
                                        {11, 2, -2.5, 2.9, 0, 0.1},
                                        {11, 3, 2.4, -0.6, 0, 0},
                                        {11, 4, -0.6, 0.2, 0, 0.1},
                                        {11, 5, -0.1, 0.5, -0.1, 0},
                                        {11, 6, -0.6, -0.3, 0, 0},
                                        {11, 7, -0.1, -1.2, 0, 0.1},
                                        {11, 8, 1.1, -1.7, -0.1, 0},
                                        {11, 9, -1, -2.9, -0.1, 0},
                                        {11, 10, -0.2, -1.8, -0.1, 0},
                                        {11, 11, 2.6, -2.3, -0.1, 0},
                                        {12, 0, -2, 0, 0, 0},
                                        {12, 1, -0.2, -1.3, 0, 0},
                                        {12, 2, 0.3, 0.7, 0, 0},
                                        {12, 3, 1.2, 1, 0, -0.1},
                                        {12, 4, -1.3, -1.4, 0, 0.1},
                                        {12, 5, 0.6, 0, 0, 0},
                                        {12, 6, 0.6, 0.6, 0.1, 0},
                                        {12, 7, 0.5, -0.1, 0, 0},
                                        {12, 8, -0.1, 0.8, 0, 0},
                                        {12, 9, -0.4, 0.1, 0, 0},
                                        {12, 10, -0.2, -1, -0.1, 0},
                                        {12, 11, -1.3, 0.1, 0, 0},
                                        {12, 12, -0.7, 0.2, -0.1, -0.1}};

/// The scalar potential over the reference radius, a sum of Schmidt semi-normalised harmonics (WMM2025 technical
/// report, (1)), with the coefficients of a year.
class GeomagneticPotential {
 public:
  explicit GeomagneticPotential(double year) {
    for (const GaussCoefficients& term : kTerms) {
      const auto index = static_cast<std::size_t>(term.m * kDegree - term.m * (term.m - 1) / 2 + term.n);
      cosines_[index] = term.g + (year - kEpoch) * term.g_rate;
      if (term.m > 0) sines_[index - (kDegree + 1)] = term.h + (year - kEpoch) * term.h_rate;
    }
  }

  Vec3 gradient(const Vec3& ecef_m) const {
    const GeographicLib::SphericalHarmonic sum(cosines_, sines_, kDegree, kReferenceRadius_m,
                                               GeographicLib::SphericalHarmonic::SCHMIDT);
    Vec3 gradient;
    sum(ecef_m.x(), ecef_m.y(), ecef_m.z(), gradient.x(), gradient.y(), gradient.z());
    return gradient;
  }

 private:
  std::vector<double> cosines_ = std::vector<double>((kDegree + 1) * (kDegree + 2) / 2);
  std::vector<double> sines_ = std::vector<double>(kDegree * (kDegree + 1) / 2);
};

}  // namespace

Vec3 geomagnetic_field_ut(const geometry::LocalFrame& frame, const Vec3& position_local, double year) {
  if (!(year >= kEpoch && year <= kEnd))
    throw InputError(
        "magnetic field",
        "the World Magnetic Model 2025 is valid from 2025 to 2030; give a year in that range, or the field itself");
  const Vec3 ecef_m = frame.T_ecef_local() * position_local;
  return frame.T_local_ecef().rotation *
         (-kReferenceRadius_m * kMicroPerNano * GeomagneticPotential(year).gradient(ecef_m));
}

Vec3 magnetic_field_from_angles_ut(double declination_deg, double inclination_deg, double strength_ut) {
  const double declination = declination_deg * kRadiansPerDegree, inclination = inclination_deg * kRadiansPerDegree;
  const double level = strength_ut * std::cos(inclination);
  return {level * std::sin(declination), level * std::cos(declination), -strength_ut * std::sin(inclination)};
}

namespace {

using geometry::SE3;
using geometry::Vec3;

constexpr std::uint64_t kMagnetometerNoise = 31;

}  // namespace

void check(const MagnetometerOptions& options) {
  if (!(options.noise_ut >= 0.0)) throw InputError("magnetometer noise", "must be 0 or more");
  if (!options.hard_iron_ut.allFinite() || !options.soft_iron.allFinite())
    throw InputError("magnetometer hard_iron", "and soft_iron must be finite");
}

std::vector<MagnetometerSample> simulate_magnetometer(const std::function<SE3(double)>& T_local_camera_at,
                                                      const std::function<Vec3(const Vec3&)>& field_at, double start_s,
                                                      double end_s, const MagnetometerOptions& options) {
  const flight_path::SampleTimes times =
      flight_path::make_sample_times("magnetometer", start_s, end_s, options.rate_hz);
  check(options);
  const std::uint64_t key = base::stream_key(options.seed, kMagnetometerNoise);
  std::vector<MagnetometerSample> samples;
  samples.reserve(times.count());
  for (std::uint64_t i = 0; i < times.count(); ++i) {
    const SE3 T_local_sensor = T_local_camera_at(times.at(i)) * options.T_camera_sensor;
    const Vec3 field = T_local_sensor.rotation.conjugate() * field_at(T_local_sensor.translation);
    const std::array<float, 4> n = base::normal_variates(key, i);
    samples.push_back(
        {times.at(i), options.soft_iron * field + options.hard_iron_ut + options.noise_ut * Vec3(n[0], n[1], n[2])});
  }
  return samples;
}

}  // namespace tileflight::sensors
