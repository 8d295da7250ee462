#include "tileflight/inertial/imu_samples.h"

namespace tileflight::inertial {

std::vector<ImuSample> reversed(const std::vector<ImuSample>& samples) {
  std::vector<ImuSample> backwards;
  backwards.reserve(samples.size());
  for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample)
    backwards.push_back({-sample->time_s, -sample->angular_rate_rad_s, sample->specific_force_m_s2});
  return backwards;
}

}  // namespace tileflight::inertial
