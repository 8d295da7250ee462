#pragma once

#include <cmath>
#include <cstdint>

#include "tileflight/base/random_numbers.h"

namespace tileflight::sensors {

/// First-order Gauss-Markov process (exponentially correlated noise), discretized exactly and started in its stationary
/// distribution.
class GaussMarkov {
 public:
  /// `sigma`: the stationary standard deviation; `time_s`: the correlation time (decay to 1 / e).
  GaussMarkov(double sigma, double time_s, double rate_hz, std::uint64_t key)
      : sigma_(sigma), decay_(std::exp(-1.0 / (rate_hz * time_s))), key_(key), value_(sigma * normal(0)) {}

  double value() const { return value_; }
  void step() { value_ = decay_ * value_ + std::sqrt(1.0 - decay_ * decay_) * sigma_ * normal(++count_); }

 private:
  double normal(std::uint64_t i) const { return base::normal_variates(key_, i)[0]; }

  double sigma_, decay_;
  std::uint64_t key_, count_ = 0;
  double value_;
};

}  // namespace tileflight::sensors
