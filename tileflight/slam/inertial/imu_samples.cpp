#include "tileflight/slam/inertial/imu_samples.h"

namespace tileflight::inertial {

std::vector<geometry::ImuSample> reversed(const std::vector<geometry::ImuSample>& samples) {
  std::vector<geometry::ImuSample> backwards;
  backwards.reserve(samples.size());
  for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample)
    backwards.push_back({-sample->time_s, -sample->angular_rate_rad_s, sample->specific_force_m_s2});
  return backwards;
}

}  // namespace tileflight::inertial
