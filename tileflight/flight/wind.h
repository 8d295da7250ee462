#pragma once

#include <cstdint>
#include <random>

#include "tileflight/geometry/transform.h"

namespace tileflight::flight {

enum class Turbulence { kNone, kLight, kModerate, kSevere };

struct WindOptions {
  geometry::Vec3 mean_m_s = geometry::Vec3::Zero();  ///< velocity of the air: east, north, up
  Turbulence turbulence = Turbulence::kNone;
  double height_above_ground_m = 20.0;  ///< that of the turbulence's table
  std::uint64_t seed = 1;
};

/// Root mean squares and length scales of gusts near the ground, along the mean wind, across it, and upwards.
struct GustScales {
  geometry::Vec3 sigma_m_s = geometry::Vec3::Zero();
  geometry::Vec3 length_m = geometry::Vec3::Ones();
};

/// MIL-F-8785C, 3.7.3.4 (low altitude): sigma_w = 0.1 W20, sigma_u = sigma_v = sigma_w / (0.177 + 0.000823 h)^0.4, L_w
/// = h, L_u = L_v = h / (0.177 + 0.000823 h)^1.2 with h in feet from 10 to 1000 (clamped), and the wind at 20 feet W20
/// of 15, 30 and 45 knots in light, moderate and severe turbulence.
GustScales gust_scales(Turbulence turbulence, double height_above_ground_m);

/// The air's velocity where a vehicle is: a mean and Dryden's gusts, frozen in the air, which the vehicle meets as fast
/// as it moves through it (no slower than 1 m/s, so that gusts also reach one that drifts with the wind). The spectra's
/// shaping filters (MIL-F-8785C, 3.7.1.2) are advanced exactly over each step, whatever its length: from the start
/// the gusts have their stationary statistics. A function of the seed and the steps.
class Wind {
 public:
  explicit Wind(const WindOptions& options);

  /// East, north, up, metres per second.
  const geometry::Vec3& velocity_m_s() const { return velocity_m_s_; }
  /// From now on; gusts go on, along and across the new mean.
  void set_mean(const geometry::Vec3& mean_m_s);
  /// Moves on by `step_s` with a vehicle of that velocity (local frame).
  void advance(double step_s, const geometry::Vec3& vehicle_velocity_m_s);

 private:
  /// The two states of the transverse filter (1 + sqrt(3) L s) / (1 + L s)^2.
  using Transverse = geometry::Vec2;

  double normal();
  Transverse transverse_noise(double step_in_lengths);
  void compose();

  WindOptions options_;
  GustScales scales_;
  geometry::Mat3 R_local_gust_;  ///< gust axes: along the mean wind, across, up
  std::mt19937_64 random_;
  double along_ = 0.0;  ///< of unit variance, like the next two's outputs
  Transverse across_ = Transverse::Zero(), up_ = Transverse::Zero();
  geometry::Vec3 velocity_m_s_ = geometry::Vec3::Zero();
};

}  // namespace tileflight::flight
