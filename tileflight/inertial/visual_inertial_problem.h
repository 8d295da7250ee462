#pragma once

// Camera odometry's keyframes and an inertial unit's samples as one least-squares problem. Unknown are, at each
// keyframe, the unit's pose, velocity and biases and the logarithm of the map's scale, and once the clocks' offset and
// the unit's mounting. The scale is a random walk with the odometry's variance (that of a monocular map drifts; that of
// a metric one stays near one), the biases are one with the unit's noise. The world's z axis points up, so that the
// direction of gravity is part of the poses.
//
// Visual-inertial smoothing over keyframes: Forster et al. 2017, VII; scale and gravity in the same problem as the
// biases: Campos, Montiel, Tardós, "Inertial-Only Optimization for Visual-Inertial Initialization", ICRA 2020, (13),
// which takes the visual path as exact; here its steps have their covariances.

#include <vector>

#include "tileflight/inertial/imu_check.h"
#include "tileflight/inertial/sparse_least_squares.h"
#include "tileflight/inertial/visual_factor.h"
#include "tileflight/inertial/visual_keyframe.h"

namespace tileflight::inertial {

/// Values of the unknowns.
struct VisualInertialState {
  std::vector<ImuState> states;   ///< at the keyframes
  std::vector<double> log_scale;  ///< of metres per map unit, at the keyframes
  double time_offset_s = 0.0;     ///< the unit's clock minus the camera's
  geometry::SE3 T_imu_camera;
};

class VisualInertialProblem {
 public:
  /// `keyframes` and `model` must outlive the problem. `time_offset_sigma_s`: of the prior `time_offset_s`. Which steps
  /// are covered by samples is decided here, for that offset, so that the cost has no jumps where the offset changes:
  /// the first and the last reading are extended by a short time.
  VisualInertialProblem(const std::vector<VisualKeyframe>& keyframes, const std::vector<geometry::ImuSample>& samples,
                        const ImuCheck& check, const ImuModel& model, double time_offset_s, double time_offset_sigma_s);

  static constexpr Eigen::Index kKeyframeSize = kStateSize + 1;  ///< of unknowns at a keyframe; the last is the scale
  Eigen::Index unknowns() const { return kKeyframeSize * keyframe_count() + 4; }
  Eigen::Index keyframe_count() const { return static_cast<Eigen::Index>(keyframes_.size()); }
  Eigen::Index time_offset_column() const { return kKeyframeSize * keyframe_count(); }

  /// Whether the samples cover the time from keyframe `k` to the next one.
  bool has_samples(std::size_t k) const { return has_samples_[k]; }
  /// These samples, preintegrated; nullopt if they do not cover it.
  std::optional<Preintegration> preintegrate_step(std::size_t k, double time_offset_s,
                                                  const geometry::ImuBias& bias) const;
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

 private:
  void add_inertial(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_visual(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_walks(std::size_t k, const VisualInertialState& at, SparseLeastSquares& sum) const;
  void add_priors(const VisualInertialState& at, SparseLeastSquares& sum) const;

  const std::vector<VisualKeyframe>& keyframes_;
  std::vector<geometry::ImuSample> samples_;  ///< extended at both ends
  const ImuModel& model_;
  double time_offset_s_, time_offset_sigma_s_;
  std::vector<bool> has_samples_;
};

}  // namespace tileflight::inertial
