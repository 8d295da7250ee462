#pragma once

// Processor time of the odometry's stages, all threads together.

#include <ctime>

#include "tileflight/odometry/odometry.h"

namespace tileflight::odometry {

/// Processor time of the whole process so far, seconds.
inline double processor_time_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Adds the processor time between its making and its end to a sum.
class StageClock {
 public:
  explicit StageClock(double& sum_s) : sum_s_(sum_s), begin_s_(processor_time_s()) {}
  ~StageClock() { sum_s_ += processor_time_s() - begin_s_; }
  StageClock(const StageClock&) = delete;
  StageClock& operator=(const StageClock&) = delete;

 private:
  double& sum_s_;
  double begin_s_;
};

/// The step's result; its processor time is added to a sum.
template <class Step>
auto timed(double& sum_s, const Step& step) {
  const StageClock clock(sum_s);
  return step();
}

}  // namespace tileflight::odometry
