#pragma once

#include <cmath>
#include <cstdint>

#include "tileflight/sensors/random_numbers.h"

namespace tileflight::sensors {

/// An error that wanders: a first-order Gauss-Markov process (exponentially correlated), exactly discretised and begun
/// in its stationary state.
class GaussMarkov {
 public:
  /// `sigma`: its standard deviation at any time; `time_s`: over which it is forgotten to 1 / e.
  GaussMarkov(double sigma, double time_s, double rate_hz, std::uint64_t key)
      : sigma_(sigma), kept_(std::exp(-1.0 / (rate_hz * time_s))), key_(key), value_(sigma * normal(0)) {}

  double value() const { return value_; }
  void step() { value_ = kept_ * value_ + std::sqrt(1.0 - kept_ * kept_) * sigma_ * normal(++count_); }

 private:
  double normal(std::uint64_t i) const { return normal_numbers(key_, i)[0]; }

  double sigma_, kept_;
  std::uint64_t key_, count_ = 0;
  double value_;
};

}  // namespace tileflight::sensors
