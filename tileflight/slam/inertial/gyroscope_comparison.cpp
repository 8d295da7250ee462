#include "tileflight/slam/inertial/gyroscope_comparison.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/alignment/time_offset.h"

namespace tileflight::inertial {
namespace {

using alignment::TimedVector;
using geometry::Mat3;
using geometry::Vec3;

/// The camera's mean rate from each pose to the next, in its own axes, at the middle of the interval.
std::vector<TimedVector> camera_rates(const geometry::Trajectory& path) {
  std::vector<TimedVector> rates;
  for (std::size_t i = 1; i < path.size(); ++i) {
    const geometry::StampedPose &a = path.poses[i - 1], &b = path.poses[i];
    const Vec3 turn = geometry::so3_log(a.T_local_camera.rotation.conjugate() * b.T_local_camera.rotation);
    rates.push_back({0.5 * (a.time_s + b.time_s), turn / (b.time_s - a.time_s)});
  }
  return rates;
}

std::vector<TimedVector> gyroscope_rates(std::span<const geometry::ImuSample> samples) {
  std::vector<TimedVector> rates;
  rates.reserve(samples.size());
  for (const geometry::ImuSample& sample : samples) rates.push_back({sample.time_s, sample.angular_rate_rad_s});
  return rates;
}

/// Length of the windows that both are averaged over: no shorter than the images are apart.
double window_s(const std::vector<TimedVector>& camera) {
  std::vector<double> intervals{0.1};
  for (std::size_t i = 1; i < camera.size(); ++i) intervals.push_back(camera[i].time_s - camera[i - 1].time_s);
  const auto middle = intervals.begin() + static_cast<std::ptrdiff_t>(intervals.size() / 2);
  std::nth_element(intervals.begin(), middle, intervals.end());
  return std::max(0.1, *middle);
}

/// Pairs of mean rates, about their means.
struct RatePairs {
  Eigen::Matrix3Xd camera, gyroscope;
};

RatePairs pair_rates(const std::vector<TimedVector>& camera, std::span<const geometry::ImuSample> samples,
                     double offset_s, double window_s) {
  std::vector<Vec3> ours, theirs;
  auto from = samples.begin(), to = samples.begin();
  for (const TimedVector& rate : camera) {
    const double middle_s = rate.time_s + offset_s;
    while (from != samples.end() && from->time_s < middle_s - 0.5 * window_s) ++from;
    while (to != samples.end() && to->time_s <= middle_s + 0.5 * window_s) ++to;
    if (to - from < 2) continue;
    Vec3 sum = Vec3::Zero();
    for (auto sample = from; sample != to; ++sample) sum += sample->angular_rate_rad_s;
    ours.push_back(rate.value);
    theirs.push_back(sum / static_cast<double>(to - from));
  }
  const auto centred = [](const std::vector<Vec3>& list) {
    Eigen::Matrix3Xd m(3, list.size());
    for (std::size_t i = 0; i < list.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = list[i];
    return Eigen::Matrix3Xd(m.colwise() - m.rowwise().mean());
  };
  return ours.empty() ? RatePairs{} : RatePairs{centred(ours), centred(theirs)};
}

double explained_share(const RatePairs& pairs, double factor, const Mat3& R_imu_camera) {
  const double whole = pairs.gyroscope.squaredNorm();
  return whole > 0.0 ? 1.0 - (pairs.gyroscope - factor * R_imu_camera * pairs.camera).squaredNorm() / whole : 0.0;
}

}  // namespace

GyroscopeComparison compare_gyroscope(const geometry::Trajectory& path, std::span<const geometry::ImuSample> samples,
                                      const Eigen::Quaterniond& R_imu_camera) {
  GyroscopeComparison comparison;
  comparison.R_imu_camera = R_imu_camera;
  const std::vector<TimedVector> camera = camera_rates(path);
  if (camera.size() < 2 || samples.size() < 2) {
    comparison.reason = "there are too few images";
    return comparison;
  }
  alignment::TimeOffsetOptions options;
  options.step_s = window_s(camera);
  options.estimate_scale = true;
  const alignment::TimeOffset found = alignment::estimate_time_offset(gyroscope_rates(samples), camera, options);
  comparison.reason = found.reason;
  comparison.determined = found.determined;
  if (!found.determined) return comparison;
  comparison.offset_s = found.offset_s;
  comparison.sigma_s = found.sigma_s;
  comparison.R_imu_camera = Eigen::Quaterniond(found.R_first_second).normalized();
  const RatePairs pairs = pair_rates(camera, samples, found.offset_s, options.step_s);
  if (pairs.camera.size() == 0 || !(pairs.camera.squaredNorm() > 0.0)) return comparison;
  comparison.rate_factor = std::sqrt(pairs.gyroscope.squaredNorm() / pairs.camera.squaredNorm());
  comparison.explained_share = explained_share(pairs, comparison.rate_factor, R_imu_camera.toRotationMatrix());
  comparison.best_share = explained_share(pairs, comparison.rate_factor, found.R_first_second);
  return comparison;
}

}  // namespace tileflight::inertial
