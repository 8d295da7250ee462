#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "tileflight/core/base/random_numbers.h"

namespace tileflight::sensors {

/// One exact step of a first-order Gauss-Markov process of stationary standard deviation `sigma`. `decay`:
/// exp(-step / correlation time); `normal`: a standard normal variate.
inline double gauss_markov_step(double value, double sigma, double decay, double normal) {
  return decay * value + std::sqrt(std::max(0.0, 1.0 - decay * decay)) * sigma * normal;
}

/// First-order Gauss-Markov process (exponentially correlated noise), discretized exactly and started in its stationary
/// distribution.
class GaussMarkov {
 public:
  /// `sigma`: the stationary standard deviation; `time_s`: the correlation time (decay to 1 / e).
  GaussMarkov(double sigma, double time_s, double rate_hz, std::uint64_t key)
      : sigma_(sigma), decay_(std::exp(-1.0 / (rate_hz * time_s))), key_(key), value_(sigma * normal(0)) {}

  double value() const { return value_; }
  void step() { value_ = gauss_markov_step(value_, sigma_, decay_, normal(++count_)); }

 private:
  double normal(std::uint64_t i) const { return base::normal_variates(key_, i)[0]; }

  double sigma_, decay_;
  std::uint64_t key_, count_ = 0;
  double value_;
};

}  // namespace tileflight::sensors
