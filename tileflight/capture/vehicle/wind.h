#pragma once

#include <cstdint>
#include <random>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::vehicle {

/// Turbulence classes of MIL-F-8785C.
enum class Turbulence { kNone, kLight, kModerate, kSevere };

/// Parameters of the wind.
struct WindOptions {
  geometry::Vec3 mean_m_s = geometry::Vec3::Zero();  ///< velocity of the air: east, north, up
  Turbulence turbulence = Turbulence::kNone;
  double height_above_ground_m = 20.0;  ///< height used for the turbulence table
  std::uint64_t seed = 1;
};

/// Standard deviations and length scales of gusts near the ground: along the mean wind, across it, and upwards.
struct GustScales {
  geometry::Vec3 sigma_m_s = geometry::Vec3::Zero();
  geometry::Vec3 length_m = geometry::Vec3::Ones();
};

/// Computes the scales of MIL-F-8785C, 3.7.3.4 (low altitude): sigma_w = 0.1 W20, sigma_u = sigma_v = sigma_w / (0.177
/// + 0.000823 h)^0.4, L_w = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2 with h in feet from 10 to 1000 (clamped), and
/// the wind at 20 feet W20 of 15, 30 and 45 knots in light, moderate and severe turbulence.
GustScales gust_scales(Turbulence turbulence, double height_above_ground_m);

/// Air velocity at a vehicle: a mean plus Dryden gusts, frozen in the air, which the vehicle meets at its airspeed (at
/// least 1 m/s, so that gusts also reach a vehicle drifting with the wind). The spectra's shaping filters (MIL-F-8785C,
/// 3.7.1.2) are advanced exactly over each step of any length and start in their stationary distribution. Deterministic
/// in the seed and the steps.
class Wind {
 public:
  explicit Wind(const WindOptions& options);

  /// East, north, up, metres per second.
  const geometry::Vec3& velocity_m_s() const { return velocity_m_s_; }
  /// Changes the mean wind; the gusts continue, along and across the new mean.
  void set_mean(const geometry::Vec3& mean_m_s);
  /// Advances by `step_s` with a vehicle of this velocity (local frame).
  void advance(double step_s, const geometry::Vec3& vehicle_velocity_m_s);

 private:
  /// The two states of the transverse filter (1 + sqrt(3) L s) / (1 + L s)^2.
  using Transverse = geometry::Vec2;

  double normal();
  Transverse transverse_noise(double step_in_lengths);
  void update_velocity();

  WindOptions options_;
  GustScales scales_;
  geometry::Mat3 R_local_gust_;  ///< gust axes: along the mean wind, across, up
  std::mt19937_64 random_;
  double along_ = 0.0;  ///< filter output of unit variance, as those of the next two
  Transverse across_ = Transverse::Zero(), up_ = Transverse::Zero();
  geometry::Vec3 velocity_m_s_ = geometry::Vec3::Zero();
};

}  // namespace tileflight::vehicle
