#pragma once

// Processor time of the odometry's stages, all threads together.

#include <ctime>

#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// Processor time of the whole process so far, seconds.
inline double cpu_time_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Adds the processor time from its construction to its destruction to a sum, seconds.
class StageTimer {
 public:
  explicit StageTimer(double& sum_s) : sum_s_(sum_s), begin_s_(cpu_time_s()) {}
  ~StageTimer() { sum_s_ += cpu_time_s() - begin_s_; }
  StageTimer(const StageTimer&) = delete;
  StageTimer& operator=(const StageTimer&) = delete;

 private:
  double& sum_s_;
  double begin_s_;
};

/// Runs `step`, adds its processor time to `sum_s` and returns its result.
template <class Step>
auto time_stage(double& sum_s, const Step& step) {
  const StageTimer clock(sum_s);
  return step();
}

}  // namespace tileflight::odometry
