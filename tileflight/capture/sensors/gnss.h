#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "tileflight/core/geometry/trajectory.h"

namespace tileflight::sensors {

/// Errors of a GNSS receiver: white noise, and a slowly varying bias (first-order Gauss-Markov: exponentially
/// correlated).
struct GnssOptions {
  std::uint64_t seed = 1;
  double rate_hz = 10.0;
  double horizontal_sigma_m = 0.25;  ///< white noise of each horizontal axis
  double vertical_sigma_m = 0.4;
  double horizontal_bias_sigma_m = 0.5;  ///< of the bias of each horizontal axis; 0: none
  double vertical_bias_sigma_m = 0.8;
  double bias_time_s = 60.0;  ///< correlation time of the bias
  double lag_s = 0.0;         ///< a fix stamped t is the position at t - lag_s
};

/// A simulated fix in the local frame.
struct GnssFix {
  double time_s = 0.0;
  geometry::Vec3 position;          ///< metres, local frame
  double horizontal_sigma_m = 0.0;  ///< standard deviation of noise and bias together, each horizontal axis
  double vertical_sigma_m = 0.0;
};

/// Simulates fixes at start, start + 1 / rate, ... up to end. Throws InputError for options out of range or end before
/// start.
std::vector<GnssFix> simulate_gnss(const std::function<geometry::Vec3(double time_s)>& position_at, double start_s,
                                   double end_s, const GnssOptions& options = {});

/// Simulates fixes over a trajectory's whole time span; positions are interpolated linearly in time.
std::vector<GnssFix> simulate_gnss(const geometry::Trajectory& trajectory, const GnssOptions& options = {});

}  // namespace tileflight::sensors
