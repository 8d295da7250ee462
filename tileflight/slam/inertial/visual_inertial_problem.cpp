#include "tileflight/slam/inertial/visual_inertial_problem.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

// A unit without noise is still sampled, and its readings are linear between samples to these densities only.
constexpr double kLeastRateDensity = 1e-5, kLeastForceDensity = 1e-4;
constexpr double kLeastRateWalk = 1e-7, kLeastForceWalk = 1e-6;
// Pictures are sampled, too: a step's errors are no smaller than this share of its length, and this angle.
constexpr double kLeastStepShare = 3e-4, kLeastTurn_rad = 2e-5;
constexpr double kLeastLogScaleStep = 1e-5;
constexpr double kLeastMetricLogScale = 2e-4;  // of a rig's calibration
// Sigmas from which on a step counts less: 95 % of good ones are below (chi square of six). The first steps after the
// odometry's initialisation can be off by more than their covariances say.
constexpr double kStepWidth = 3.55;

ImuNoise floored(const ImuNoise& noise) {
  return {.accelerometer_noise_density = std::max(noise.accelerometer_noise_density, kLeastForceDensity),
          .accelerometer_random_walk = std::max(noise.accelerometer_random_walk, kLeastForceWalk),
          .gyroscope_noise_density = std::max(noise.gyroscope_noise_density, kLeastRateDensity),
          .gyroscope_random_walk = std::max(noise.gyroscope_random_walk, kLeastRateWalk)};
}

Index column_of(std::size_t keyframe) { return VisualInertialProblem::kKeyframeSize * static_cast<Index>(keyframe); }

// Time by which the readings extend beyond both ends, and the part of it that a step may need at the first offset.
constexpr double kGoesOn_s = 0.25, kMayNeed_s = 0.02;
// Half the time over which readings are averaged to move a pose along: the shortest is short against the motions of
// hands, and it is doubled as long as the mean stays within this many sigmas of the means before (95 % of three axes).
constexpr double kShortestHalf_s = 0.025, kLongestHalf_s = 0.4, kSameMean = 2.8;

std::vector<geometry::ImuSample> going_on(const std::vector<geometry::ImuSample>& samples) {
  std::vector<geometry::ImuSample> longer = samples;
  geometry::ImuSample before = samples.front(), after = samples.back();
  before.time_s -= kGoesOn_s;
  after.time_s += kGoesOn_s;
  longer.insert(longer.begin(), before);
  longer.push_back(after);
  return longer;
}

/// Mean of the samples at most `half_s` before or after `at_s`; at least one.
MeanReading mean_reading(const std::vector<geometry::ImuSample>& samples, double at_s, double half_s) {
  auto sample = std::ranges::lower_bound(samples, at_s - half_s, {}, &geometry::ImuSample::time_s);
  if (sample == samples.end()) --sample;
  MeanReading mean;
  int count = 0;
  for (; sample != samples.end() && (count == 0 || sample->time_s <= at_s + half_s); ++sample, ++count) {
    mean.angular_rate_rad_s += sample->angular_rate_rad_s;
    mean.specific_force_m_s2 += sample->specific_force_m_s2;
  }
  return {mean.angular_rate_rad_s / count, mean.specific_force_m_s2 / count, half_s};
}

/// The mean over the longest time in which the turning rate does not differ from that of shorter times by more than
/// noise does (Lepski's method), so that a gentle flight's noise is averaged away and a shaken camera's motion is not.
MeanReading reading_about(const std::vector<geometry::ImuSample>& samples, double at_s, const ImuNoise& noise) {
  std::vector<MeanReading> means = {mean_reading(samples, at_s, kShortestHalf_s)};
  while (2.0 * means.back().half_s <= kLongestHalf_s) {
    const MeanReading longer = mean_reading(samples, at_s, 2.0 * means.back().half_s);
    const bool is_same = std::ranges::all_of(means, [&](const MeanReading& shorter) {
      const double sigma = noise.gyroscope_noise_density * std::sqrt(0.5 / shorter.half_s - 0.5 / longer.half_s);
      return (longer.angular_rate_rad_s - shorter.angular_rate_rad_s).norm() <= kSameMean * sigma;
    });
    if (!is_same) break;
    means.push_back(longer);
  }
  return means.back();
}

}  // namespace

VisualInertialProblem::VisualInertialProblem(const std::vector<VisualKeyframe>& keyframes,
                                             const std::vector<geometry::ImuSample>& samples, const ImuCheck& check,
                                             const ImuModel& model, double time_offset_s, double time_offset_sigma_s)
    : keyframes_(keyframes),
      samples_(going_on(samples)),
      model_(model),
      time_offset_s_(time_offset_s),
      time_offset_sigma_s_(time_offset_sigma_s),
      integration_offset_s_(time_offset_s) {
  for (std::size_t k = 0; k + 1 < keyframes.size(); ++k) {
    const double from_s = keyframes[k].time_s + time_offset_s, to_s = keyframes[k + 1].time_s + time_offset_s;
    has_samples_.push_back(from_s >= samples.front().time_s - kMayNeed_s &&
                           to_s <= samples.back().time_s + kMayNeed_s && check.covers(from_s, to_s));
  }
  find_readings();
}

VisualInertialProblem VisualInertialProblem::integrated_at(double offset_s) const {
  VisualInertialProblem other = *this;
  other.integration_offset_s_ = offset_s;
  other.find_readings();
  return other;
}

void VisualInertialProblem::find_readings() {
  readings_.assign(keyframes_.size(), std::nullopt);
  for (std::size_t k = 0; k < keyframes_.size(); ++k) {
    const bool is_covered = (k > 0 && has_samples_[k - 1]) || (k + 1 < keyframes_.size() && has_samples_[k]);
    if (is_covered)
      readings_[k] = reading_about(samples_, keyframes_[k].time_s + integration_offset_s_, floored(model_.noise));
  }
}

LaterState VisualInertialProblem::at_camera(std::size_t k, const VisualInertialState& at) const {
  const MeanReading none{at.states[k].bias.gyroscope_rad_s, at.states[k].bias.accelerometer_m_s2, 0.0};
  const double later_s = readings_[k] ? at.time_offset_s - integration_offset_s_ : 0.0;
  LaterState camera = moved_on(at.states[k], readings_[k].value_or(none), later_s, model_.gravity_m_s2);
  if (!readings_[k]) camera.by_time.setZero();
  return camera;
}

VisualInertialState VisualInertialProblem::carried_over(const VisualInertialState& from,
                                                        const VisualInertialProblem& to) const {
  VisualInertialState at = from;
  at.time_offset_s = to.integration_offset_s_;
  VisualInertialState carried = from;
  for (std::size_t k = 0; k < at.states.size(); ++k) carried.states[k] = at_camera(k, at).state;
  return carried;
}

double VisualInertialProblem::information_of_noise() const {
  const double rate_variance = model_.noise.gyroscope_noise_density * model_.noise.gyroscope_noise_density;
  double sum = 0.0;
  for (std::size_t k = 0; k + 1 < keyframes_.size(); ++k) {
    if (!has_samples_[k]) continue;
    const double first_s = 2.0 * readings_[k]->half_s, second_s = 2.0 * readings_[k + 1]->half_s;  // averaged
    const double dt = keyframes_[k + 1].time_s - keyframes_[k].time_s;
    const Mat3 turn = visual_step(k).covariance.bottomRightCorner<3, 3>() + rate_variance * dt * Mat3::Identity();
    sum += rate_variance * (1.0 / first_s + 1.0 / second_s) * geometry::symmetric_inverse(turn).trace();
  }
  return sum;
}

std::optional<Preintegration> VisualInertialProblem::preintegrate_step(std::size_t k, double time_offset_s,
                                                                       const geometry::ImuBias& bias) const {
  if (!has_samples_[k]) return std::nullopt;
  return preintegrate(samples_, keyframes_[k].time_s + time_offset_s, keyframes_[k + 1].time_s + time_offset_s, bias,
                      floored(model_.noise));
}

VisualStep VisualInertialProblem::visual_step(std::size_t k) const {
  VisualStep step{keyframes_[k].T_map_camera.inverse() * keyframes_[k + 1].T_map_camera,
                  keyframes_[k + 1].step_covariance};
  const double least = kLeastStepShare * step.T_first_second.translation.norm();
  step.covariance.diagonal().head<3>().array() += least * least + 1e-12;
  step.covariance.diagonal().tail<3>().array() += kLeastTurn_rad * kLeastTurn_rad;
  return step;
}

void VisualInertialProblem::add_inertial(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const {
  const ImuState &first = at.states[k], &second = at.states[k + 1];
  const auto between = preintegrate_step(k, integration_offset_s_, first.bias);
  if (!between) return;
  const InertialResidual r = inertial_residual(*between, first, second, model_.gravity_m_s2);
  sum.add(r.value, geometry::symmetric_inverse(between->covariance),
          {{column_of(k), r.by_first}, {column_of(k + 1), r.by_second}});
}

void VisualInertialProblem::add_visual(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const {
  const VisualStep step = visual_step(k);
  const LaterState first = at_camera(k, at), second = at_camera(k + 1, at);
  const VisualResidual r = visual_residual(step, first.state, second.state, at.T_imu_camera, at.log_scale[k]);
  const Mat6 by_first = r.by_first.leftCols<6>(), by_second = r.by_second.leftCols<6>();  // of the poses
  sum.add_robust(r.value, geometry::symmetric_inverse(step.covariance), kStepWidth,
                 {{column_of(k), by_first * first.by_state},
                  {column_of(k) + kStateSize, r.by_log_scale},
                  {column_of(k + 1), by_second * second.by_state},
                  {time_offset_column(), by_first * first.by_time + by_second * second.by_time},
                  {time_offset_column() + 1, r.by_mounting}});
}

double VisualInertialProblem::step_sigmas(std::size_t k, const VisualInertialState& at) const {
  const VisualStep step = visual_step(k);
  const geometry::Vec6 r =
      visual_residual(step, at_camera(k, at).state, at_camera(k + 1, at).state, at.T_imu_camera, at.log_scale[k]).value;
  return std::sqrt(r.dot(step.covariance.ldlt().solve(r)));
}

/// Forster (47) and (48), and the same for the scale.
void VisualInertialProblem::add_walks(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const {
  const double dt = keyframes_[k + 1].time_s - keyframes_[k].time_s;
  const ImuNoise noise = floored(model_.noise);
  const geometry::ImuBias &a = at.states[k].bias, &b = at.states[k + 1].bias;
  Eigen::Matrix<double, 7, 1> residual, variance;
  residual << b.gyroscope_rad_s - a.gyroscope_rad_s, b.accelerometer_m_s2 - a.accelerometer_m_s2,
      at.log_scale[k + 1] - at.log_scale[k];
  variance << Vec3::Constant(noise.gyroscope_random_walk * noise.gyroscope_random_walk * dt),
      Vec3::Constant(noise.accelerometer_random_walk * noise.accelerometer_random_walk * dt),
      keyframes_[k + 1].step_log_scale_variance + kLeastLogScaleStep * kLeastLogScaleStep;
  const MatrixXd one = MatrixXd::Identity(7, 7);  // biases and scale are the last unknowns of a keyframe
  sum.add(residual, variance.cwiseInverse().asDiagonal().toDenseMatrix(),
          {{column_of(k) + kGyroscopeBias, -one}, {column_of(k + 1) + kGyroscopeBias, one}});
}

SparseLeastSquares VisualInertialProblem::measurements(const VisualInertialState& at) const {
  SparseLeastSquares sum(unknowns());
  for (std::size_t k = 0; k + 1 < keyframes_.size(); ++k) {
    add_inertial(k, at, sum);
    add_visual(k, at, sum);
    add_walks(k, at, sum);
  }
  return sum;
}

void VisualInertialProblem::add_priors(const VisualInertialState& at, SparseLeastSquares& sum) const {
  const auto add = [&](const VectorXd& residual, double sigma, Index column, const MatrixXd& derivative) {
    sum.add(residual, MatrixXd::Identity(residual.size(), residual.size()) / (sigma * sigma), {{column, derivative}});
  };
  const MatrixXd one = MatrixXd::Identity(3, 3);
  const ImuState& first = at.states.front();
  add(first.bias.gyroscope_rad_s, model_.gyroscope_bias_sigma, kGyroscopeBias, one);
  add(first.bias.accelerometer_m_s2, model_.accelerometer_bias_sigma, kAccelerometerBias, one);
  const Vec3 turned = geometry::so3_log(model_.T_imu_camera.rotation.conjugate() * at.T_imu_camera.rotation);
  add(turned, model_.mounting_sigma_rad, time_offset_column() + 1, geometry::so3_right_jacobian_inverse(turned));
  add(VectorXd::Constant(1, at.time_offset_s - time_offset_s_), time_offset_sigma_s_, time_offset_column(),
      MatrixXd::Identity(1, 1));
  // Position and heading are not observable; they are held where they are. Scale and velocities are held so loosely
  // that nothing is told by it, only that the equations stay regular where the samples stop.
  const Mat3 R = first.T_world_imu.rotation.toRotationMatrix();
  add(VectorXd::Zero(3), 1e-3, kPosition, one);
  add(VectorXd::Zero(1), 1e-4, kRotation, R.row(2));
  for (std::size_t k = 0; k < at.states.size(); ++k) {
    add(VectorXd::Zero(3), 1e3, column_of(k) + kVelocity, one);
    const VisualKeyframe& keyframe = keyframes_[k];
    if (keyframe.is_metric) {
      // An error of the rig's scale is the same at all keyframes: together they tell no more than one of them.
      const double variance = keyframe.step_log_scale_variance + kLeastMetricLogScale * kLeastMetricLogScale;
      add(VectorXd::Constant(1, at.log_scale[k]), std::sqrt(variance * static_cast<double>(at.states.size())),
          column_of(k) + kStateSize, MatrixXd::Identity(1, 1));
    } else {
      add(VectorXd::Zero(1), 10.0, column_of(k) + kStateSize, MatrixXd::Identity(1, 1));
    }
  }
}

SparseLeastSquares VisualInertialProblem::linearize(const VisualInertialState& at) const {
  SparseLeastSquares sum = measurements(at);
  add_priors(at, sum);
  return sum;
}

VisualInertialState VisualInertialProblem::moved(const VisualInertialState& from, const VectorXd& step) const {
  VisualInertialState to = from;
  for (std::size_t k = 0; k < from.states.size(); ++k) {
    to.states[k] = perturbed(from.states[k], step.segment<kStateSize>(column_of(k)));
    to.log_scale[k] += step[column_of(k) + kStateSize];
  }
  to.time_offset_s += step[time_offset_column()];
  to.T_imu_camera = SE3(from.T_imu_camera.rotation * geometry::so3_exp(step.segment<3>(time_offset_column() + 1)),
                        from.T_imu_camera.translation);
  return to;
}

}  // namespace tileflight::inertial
