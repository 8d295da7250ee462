#include "tileflight/slam/inertial/imu_samples.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/order_statistics.h"

namespace tileflight::inertial {

ImuNoise at_least_scatter(ImuNoise noise, const std::vector<geometry::ImuSample>& samples) {
  constexpr std::size_t kFewest = 100;
  if (samples.size() < kFewest) return noise;
  constexpr double kSecondDifference = 6.0;  // 1 + 4 + 1: its variance, for white noise of variance 1
  double gyroscope = 0.0, accelerometer = 0.0;
  std::vector<double> periods_s;
  for (std::size_t i = 1; i + 1 < samples.size(); ++i) {
    const geometry::ImuSample &a = samples[i - 1], &b = samples[i], &c = samples[i + 1];
    gyroscope += (a.angular_rate_rad_s - 2.0 * b.angular_rate_rad_s + c.angular_rate_rad_s).squaredNorm();
    accelerometer += (a.specific_force_m_s2 - 2.0 * b.specific_force_m_s2 + c.specific_force_m_s2).squaredNorm();
    periods_s.push_back(b.time_s - a.time_s);
  }
  const double values = 3.0 * kSecondDifference * static_cast<double>(periods_s.size());
  const double period_s = base::median(periods_s);
  noise.gyroscope_noise_density = std::max(noise.gyroscope_noise_density, std::sqrt(gyroscope / values * period_s));
  noise.accelerometer_noise_density =
      std::max(noise.accelerometer_noise_density, std::sqrt(accelerometer / values * period_s));
  return noise;
}

std::vector<geometry::ImuSample> reversed(const std::vector<geometry::ImuSample>& samples) {
  std::vector<geometry::ImuSample> backwards;
  backwards.reserve(samples.size());
  for (auto sample = samples.rbegin(); sample != samples.rend(); ++sample)
    backwards.push_back({-sample->time_s, -sample->angular_rate_rad_s, sample->specific_force_m_s2});
  return backwards;
}

}  // namespace tileflight::inertial
