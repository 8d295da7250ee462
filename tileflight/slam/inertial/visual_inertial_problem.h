#pragma once

// Camera odometry's keyframes and an inertial unit's samples as one least-squares problem. Unknown are, at each
// keyframe, the unit's pose, velocity and biases and the logarithm of the map's scale, and once the clocks' offset and
// the unit's mounting. The states are those at the keyframes' times by a fixed offset of the clocks, between which the
// samples are integrated once; what is left of the offset moves the camera's poses along (as the features of Qin and
// Shen, "Online Temporal Calibration for Monocular Visual-Inertial Systems", IROS 2018, III). Samples integrated
// between ends that move would let their noise tell the offset. The scale is a random walk with the odometry's variance
// (that of a monocular map drifts; that of a metric one stays near one), the biases are one with the unit's noise. The
// world's z axis points up, so that the direction of gravity is part of the poses.
//
// Visual-inertial smoothing over keyframes: Forster et al. 2017, VII; scale and gravity in the same problem as the
// biases: Campos, Montiel, Tardós, "Inertial-Only Optimization for Visual-Inertial Initialization", ICRA 2020, (13),
// which takes the visual path as exact; here its steps have their covariances.

#include <vector>

#include "tileflight/slam/inertial/factors.h"
#include "tileflight/slam/inertial/imu_check.h"
#include "tileflight/slam/inertial/sparse_least_squares.h"
#include "tileflight/slam/inertial/visual_keyframe.h"

namespace tileflight::inertial {

/// Values of the unknowns.
struct VisualInertialState {
  std::vector<ImuState> states;   ///< at the keyframes, by the problem's integration_offset_s()
  std::vector<double> log_scale;  ///< of metres per map unit, at the keyframes
  double time_offset_s = 0.0;     ///< the unit's clock minus the camera's
  geometry::SE3 T_imu_camera;
};

class VisualInertialProblem {
 public:
  /// `keyframes` and `model` must outlive the problem. `time_offset_sigma_s`: of the prior `time_offset_s`. Which steps
  /// are covered by samples is decided here, for that offset, which is also integration_offset_s().
  VisualInertialProblem(const std::vector<VisualKeyframe>& keyframes, const std::vector<geometry::ImuSample>& samples,
                        const ImuCheck& check, const ImuModel& model, double time_offset_s, double time_offset_sigma_s);

  /// Returns the problem with the samples integrated at another offset of the clocks: the first and the last reading go
  /// on for a short time.
  VisualInertialProblem integrated_at(double offset_s) const;
  double integration_offset_s() const { return integration_offset_s_; }
  /// Returns the states and the offset of `from` in the problem `to`.
  VisualInertialState carried_over(const VisualInertialState& from, const VisualInertialProblem& to) const;

  static constexpr Eigen::Index kKeyframeSize = kStateSize + 1;  ///< of unknowns at a keyframe; the last is the scale
  Eigen::Index unknowns() const { return kKeyframeSize * keyframe_count() + 4; }
  Eigen::Index keyframe_count() const { return static_cast<Eigen::Index>(keyframes_.size()); }
  Eigen::Index time_offset_column() const { return kKeyframeSize * keyframe_count(); }

  /// Returns whether the samples cover the time from keyframe `k` to the next one.
  bool has_samples(std::size_t k) const { return has_samples_[k]; }
  /// Preintegrates the samples from keyframe `k` to the next one; nullopt if they do not cover that time.
  std::optional<Preintegration> preintegrate_step(std::size_t k, double time_offset_s,
                                                  const geometry::ImuBias& bias) const;
  /// Returns how far the states are from the camera's step from keyframe `k` to the next one, in its sigmas.
  double step_sigmas(std::size_t k, const VisualInertialState& at) const;
  /// Returns how much information about the offset, 1 / s^2, only seems to be in measurements(): the noise of the
  /// turning rates that move the poses along, which is no turning.
  double information_of_noise() const;
  /// The camera's step from keyframe `k` to the next one.
  VisualStep visual_step(std::size_t k) const;

  /// The measurements alone; singular in directions that they do not determine.
  SparseLeastSquares measurements(const VisualInertialState& at) const;
  /// Measurements, what was known before, and position and heading of the first keyframe held.
  SparseLeastSquares linearize(const VisualInertialState& at) const;
  VisualInertialState moved(const VisualInertialState& from, const Eigen::VectorXd& step) const;

  const std::vector<VisualKeyframe>& keyframes() const { return keyframes_; }
  const ImuModel& model() const { return model_; }
  double time_offset_s() const { return time_offset_s_; }
  double time_offset_sigma_s() const { return time_offset_sigma_s_; }

 private:
  LaterState at_camera(std::size_t k, const VisualInertialState& at) const;
  void find_readings();
  void add_inertial(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_visual(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_walks(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_priors(const VisualInertialState& at, SparseLeastSquares& sum) const;

  const std::vector<VisualKeyframe>& keyframes_;
  std::vector<geometry::ImuSample> samples_;  ///< extended at both ends
  const ImuModel& model_;
  double time_offset_s_, time_offset_sigma_s_, integration_offset_s_;
  std::vector<bool> has_samples_;
  std::vector<std::optional<MeanReading>> readings_;  ///< at the keyframes; nullopt next to no step with samples
};

}  // namespace tileflight::inertial
