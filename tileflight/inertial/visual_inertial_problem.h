#pragma once

// Camera odometry's keyframes and an inertial unit's samples as one least-squares problem. Unknown are, at each
// keyframe, the unit's pose, velocity and biases and the logarithm of the map's scale, and once the clocks' offset and
// the unit's mounting. The scale wanders from keyframe to keyframe as far as the odometry says that it may (a monocular
// map's does; a metric one's stays near one), the biases as the unit's noise says. The world's z axis points up, so
// that gravity is no unknown but the poses' tilt.
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
  /// `keyframes` and `model` must outlive the problem. `time_offset_sigma_s`: of `time_offset_s`, known beforehand.
  /// Which steps have whole samples is decided here, by that offset, so that the cost has no jumps where the offset
  /// moves: before the first sample and after the last one their readings go on for a short while.
  VisualInertialProblem(const std::vector<VisualKeyframe>& keyframes, const std::vector<ImuSample>& samples,
                        const ImuCheck& check, const ImuModel& model, double time_offset_s, double time_offset_sigma_s);

  static constexpr Eigen::Index kKeyframeSize = kStateSize + 1;  ///< of unknowns at a keyframe; the last is the scale
  Eigen::Index unknowns() const { return kKeyframeSize * keyframe_count() + 4; }
  Eigen::Index keyframe_count() const { return static_cast<Eigen::Index>(keyframes_.size()); }
  Eigen::Index time_offset_column() const { return kKeyframeSize * keyframe_count(); }

  /// Whether the samples from keyframe `k` to the next one are whole.
  bool has_samples(std::size_t k) const { return has_samples_[k]; }
  /// These samples; nullopt if they are not whole.
  std::optional<Preintegration> preintegrate_step(std::size_t k, double time_offset_s, const ImuBias& bias) const;
  /// The camera's step from keyframe `k` to the next one.
  VisualStep visual_step(std::size_t k) const;

  /// The measurements alone: what they leave open is singular.
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
  std::vector<ImuSample> samples_;  ///< with what goes on at both ends
  const ImuModel& model_;
  double time_offset_s_, time_offset_sigma_s_;
  std::vector<bool> has_samples_;
};

}  // namespace tileflight::inertial
