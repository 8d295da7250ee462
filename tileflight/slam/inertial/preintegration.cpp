#include "tileflight/slam/inertial/preintegration.h"

#include <algorithm>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {
namespace {

using geometry::Mat3;
using geometry::skew;
using geometry::so3_exp;
using geometry::Vec3;

/// Reading at a time between two samples.
geometry::ImuSample interpolated(const geometry::ImuSample& before, const geometry::ImuSample& after, double time_s) {
  const double w = (time_s - before.time_s) / (after.time_s - before.time_s);
  return {time_s, (1.0 - w) * before.angular_rate_rad_s + w * after.angular_rate_rad_s,
          (1.0 - w) * before.specific_force_m_s2 + w * after.specific_force_m_s2};
}

/// Reading at `time_s`, with `after` the first sample that is not before it.
geometry::ImuSample reading_at(std::span<const geometry::ImuSample> samples, std::size_t after, double time_s) {
  return samples[after].time_s == time_s ? samples[after] : interpolated(samples[after - 1], samples[after], time_s);
}

std::size_t first_not_before(std::span<const geometry::ImuSample> samples, double time_s) {
  const auto found = std::lower_bound(samples.begin(), samples.end(), time_s,
                                      [](const geometry::ImuSample& sample, double t) { return sample.time_s < t; });
  return static_cast<std::size_t>(found - samples.begin());
}

/// One step with the mean of two readings.
void integrate(const geometry::ImuSample& begin, const geometry::ImuSample& end, const ImuNoise& noise,
               Preintegration& sum) {
  const double dt = end.time_s - begin.time_s;
  const Vec3 rate = 0.5 * (begin.angular_rate_rad_s + end.angular_rate_rad_s) - sum.bias.gyroscope_rad_s;
  const Vec3 force = 0.5 * (begin.specific_force_m_s2 + end.specific_force_m_s2) - sum.bias.accelerometer_m_s2;
  Increment& d = sum.increment;
  const Eigen::Quaterniond half = so3_exp(0.5 * dt * rate), whole = so3_exp(dt * rate);
  const Mat3 R = d.rotation.toRotationMatrix(), R_middle = R * half.toRotationMatrix();

  // Forster (62) and (63): errors are carried by A, and added to by the readings' noise through B.
  Mat9 A = Mat9::Identity();
  A.block<3, 3>(0, 0) = whole.toRotationMatrix().transpose();
  A.block<3, 3>(3, 0) = -dt * R * skew(half * force);
  A.block<3, 3>(6, 0) = 0.5 * dt * A.block<3, 3>(3, 0);
  A.block<3, 3>(6, 3) = dt * Mat3::Identity();
  Mat93 B_rate, B_force;
  B_rate.topRows<3>() = dt * geometry::so3_right_jacobian(dt * rate);
  B_rate.middleRows<3>(3) = -0.5 * dt * dt * R_middle * skew(force) * geometry::so3_right_jacobian(0.5 * dt * rate);
  B_rate.bottomRows<3>() = 0.5 * dt * B_rate.middleRows<3>(3);
  B_force << Mat3::Zero(), dt * R_middle, 0.5 * dt * dt * R_middle;
  const double rate_variance = noise.gyroscope_noise_density * noise.gyroscope_noise_density / dt;
  const double force_variance = noise.accelerometer_noise_density * noise.accelerometer_noise_density / dt;
  sum.covariance = A * sum.covariance * A.transpose() + rate_variance * B_rate * B_rate.transpose() +
                   force_variance * B_force * B_force.transpose();
  sum.by_gyroscope_bias = A * sum.by_gyroscope_bias - B_rate;
  sum.by_accelerometer_bias = A * sum.by_accelerometer_bias - B_force;

  d.position += dt * d.velocity + 0.5 * dt * dt * (R_middle * force);
  d.velocity += dt * (R_middle * force);
  d.rotation = (d.rotation * whole).normalized();
  sum.duration_s += dt;
}

}  // namespace

Increment Preintegration::corrected(const geometry::ImuBias& other) const {
  const Eigen::Matrix<double, 9, 1> change =
      by_gyroscope_bias * (other.gyroscope_rad_s - bias.gyroscope_rad_s) +
      by_accelerometer_bias * (other.accelerometer_m_s2 - bias.accelerometer_m_s2);
  return {(increment.rotation * so3_exp(change.head<3>())).normalized(), increment.velocity + change.segment<3>(3),
          increment.position + change.tail<3>()};
}

std::optional<Preintegration> preintegrate(std::span<const geometry::ImuSample> samples, double from_s, double to_s,
                                           const geometry::ImuBias& bias, const ImuNoise& noise) {
  if (samples.empty() || !(to_s > from_s) || samples.front().time_s > from_s || samples.back().time_s < to_s)
    return std::nullopt;
  Preintegration sum;
  sum.bias = bias;
  std::size_t next = first_not_before(samples, from_s);
  geometry::ImuSample before = reading_at(samples, next, from_s);
  if (samples[next].time_s == from_s) ++next;
  for (; next < samples.size() && samples[next].time_s < to_s; ++next) {
    integrate(before, samples[next], noise, sum);
    before = samples[next];
  }
  integrate(before, reading_at(samples, next, to_s), noise, sum);
  return sum;
}

}  // namespace tileflight::inertial
