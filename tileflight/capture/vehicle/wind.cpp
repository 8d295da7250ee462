#include "tileflight/capture/vehicle/wind.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace tileflight::vehicle {
namespace {

using geometry::Mat3;
using geometry::Vec2;
using geometry::Vec3;

constexpr double kMetresPerFoot = 0.3048;
constexpr double kMetresPerSecondPerKnot = 0.514444;
constexpr double kMinAirspeed_m_s = 1.0;

double wind_at_20_feet_knots(Turbulence turbulence) {
  switch (turbulence) {
    case Turbulence::kNone:
      return 0.0;
    case Turbulence::kLight:
      return 15.0;
    case Turbulence::kModerate:
      return 30.0;
    case Turbulence::kSevere:
      return 45.0;
  }
  return 0.0;
}

/// The integral of t^n exp(-2t) from 0 to x for n = 0, 1, 2: a series where the closed form would suffer from
/// cancellation.
std::array<double, 3> exponential_moments(double x) {
  if (x < 0.5) {
    std::array<double, 3> sum{};
    for (int n = 0; n < 3; ++n) {
      double term = std::pow(x, n + 1);
      for (int k = 0; k < 16; ++k) {
        sum[n] += term / (n + k + 1);
        term *= -2.0 * x / (k + 1);
      }
    }
    return sum;
  }
  const double e = std::exp(-2.0 * x);
  return {(1 - e) / 2, (1 - e * (1 + 2 * x)) / 4, (1 - e * (1 + 2 * x + 2 * x * x)) / 4};
}

/// Columns: horizontally along the wind (east where there is none), left of it, up.
Mat3 gust_axes(const Vec3& mean_m_s) {
  Vec3 along(mean_m_s.x(), mean_m_s.y(), 0.0);
  along = along.norm() > 1e-9 ? along.normalized() : Vec3::UnitX();
  Mat3 axes;
  axes << along, Vec3::UnitZ().cross(along), Vec3::UnitZ();
  return axes;
}

/// Output of the transverse filter; unit variance if its states are stationary.
double transverse_output(const Vec2& x) {
  constexpr double kRoot3 = std::numbers::sqrt3;
  return (1.0 - kRoot3) * x[0] + kRoot3 * x[1];
}

/// Noise-free evolution of the transverse filter's states: both poles at -1/L.
Vec2 decay_transverse(const Vec2& x, double step_in_lengths) {
  return std::exp(-step_in_lengths) * Vec2(x[0] + step_in_lengths * x[1], x[1]);
}

}  // namespace

GustScales gust_scales(Turbulence turbulence, double height_above_ground_m) {
  const double h_ft = std::clamp(height_above_ground_m / kMetresPerFoot, 10.0, 1000.0);
  const double base = 0.177 + 0.000823 * h_ft;
  const double up_m_s = 0.1 * wind_at_20_feet_knots(turbulence) * kMetresPerSecondPerKnot;
  const double level_m_s = up_m_s / std::pow(base, 0.4);
  const double level_m = h_ft / std::pow(base, 1.2) * kMetresPerFoot;
  return {{level_m_s, level_m_s, up_m_s}, {level_m, level_m, h_ft * kMetresPerFoot}};
}

Wind::Wind(const WindOptions& options)
    : options_(options),
      scales_(gust_scales(options.turbulence, options.height_above_ground_m)),
      R_local_gust_(gust_axes(options.mean_m_s)),
      random_(options.seed) {
  constexpr double kLongAgo = std::numeric_limits<double>::max();
  along_ = normal();
  across_ = transverse_noise(kLongAgo);
  up_ = transverse_noise(kLongAgo);
  update_velocity();
}

void Wind::set_mean(const Vec3& mean_m_s) {
  options_.mean_m_s = mean_m_s;
  R_local_gust_ = gust_axes(mean_m_s);
  update_velocity();
}

void Wind::advance(double step_s, const Vec3& vehicle_velocity_m_s) {
  if (options_.turbulence == Turbulence::kNone) return;
  const double speed_m_s = std::max(kMinAirspeed_m_s, (vehicle_velocity_m_s - options_.mean_m_s).norm());
  const Vec3 steps = (speed_m_s * step_s * scales_.length_m.cwiseInverse()).eval();
  const double kept = std::exp(-steps.x());
  along_ = kept * along_ + std::sqrt(1.0 - kept * kept) * normal();
  across_ = decay_transverse(across_, steps.y()) + transverse_noise(steps.y());
  up_ = decay_transverse(up_, steps.z()) + transverse_noise(steps.z());
  update_velocity();
}

/// Noise added to the transverse filter's states over a step, with the covariance of the exact solution: for x1' = x2 -
/// x1, x2' = w - x2 it is the integral of exp(-2t) (t, 1)(t, 1)^T.
Wind::Transverse Wind::transverse_noise(double step_in_lengths) {
  const auto [m0, m1, m2] = exponential_moments(std::min(step_in_lengths, 50.0));
  const double first = normal(), second = normal();
  const double shared = std::sqrt(m0);  // Cholesky factorization, starting with x2
  return {m1 / shared * first + std::sqrt(std::max(0.0, m2 - m1 * m1 / m0)) * second, shared * first};
}

/// Box and Muller 1958 on the generator's bits: the standard library's distribution differs between implementations.
double Wind::normal() {
  const auto uniform = [this] { return (static_cast<double>(random_() >> 11U) + 1.0) * 0x1p-53; };  // (0, 1]
  const double radius = std::sqrt(-2.0 * std::log(uniform()));
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

void Wind::update_velocity() {
  const Vec3 unit(along_, transverse_output(across_), transverse_output(up_));
  velocity_m_s_ = options_.mean_m_s + R_local_gust_ * scales_.sigma_m_s.cwiseProduct(unit);
}

}  // namespace tileflight::vehicle
