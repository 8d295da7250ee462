#pragma once

// An inertial unit's readings in the window: tight visual-inertial coupling. The map keeps its own frame and scale.
// Further unknowns are the world in which the map lies (its vertical, two angles, and the logarithm of its metres per
// map unit), and, for each keyframe since the coupling began, velocity and biases of the unit. Residuals between
// keyframes that follow one another are the preintegrated readings': von Stumberg, Usenko, Cremers, "Direct Sparse
// Visual-Inertial Odometry using Dynamic Marginalization", ICRA 2018 (VI-DSO), section III; readings as in Forster et
// al. 2017.
//
// Two priors are kept: the window's own, of the images alone, and the joint one of this class. The joint one is
// linearised at the scale with which it began; it is dropped, and begun anew from the window's own and from the
// smoothing over all keyframes, when that knows the scale much better. That is the replacement of the prior by a pose
// graph's result in von Stumberg, Cremers, "DM-VIO: Delayed Marginalization Visual-Inertial Odometry", IEEE RA-L 7(2),
// 2022, with the inertial readings before the beginning as one Gaussian instead of a second, delayed window.

#include <optional>
#include <vector>

#include "tileflight/slam/inertial/align_to_gravity.h"
#include "tileflight/slam/inertial/factors.h"
#include "tileflight/slam/mapping/normal_equations.h"

namespace tileflight::mapping {

/// State of the newest keyframe, from smoothing over the keyframes so far, with which the coupling begins.
struct InertialStart {
  Eigen::Quaterniond R_world_map = Eigen::Quaterniond::Identity();  ///< the world's z axis points up
  double log_scale = 0.0;                                           ///< of metres per map unit
  geometry::Vec3 velocity_m_s = geometry::Vec3::Zero();             ///< of the unit, world axes
  geometry::ImuBias bias;
  inertial::Mat12 covariance = inertial::Mat12::Identity();  ///< inertial::InertialAlignment::latest_covariance
};

/// Parameters of the unit that do not change while the window is coupled.
struct InertialCalibration {
  geometry::SE3 T_imu_camera;
  inertial::ImuNoise noise;
  double gravity_m_s2 = 9.80665;
};

class InertialWindow {
 public:
  static constexpr int kWorldSize = 3;     ///< tilt about the world's x and y axis, logarithm of the scale
  static constexpr int kKeyframeSize = 9;  ///< velocity, gyroscope's and accelerometer's bias

  /// Begins at the newest keyframe of a window of at least two. `weight`: of a unit of squared normalised residual, in
  /// squared grey values, the unit of the window's energy.
  InertialWindow(const keyframes::Window& window, const InertialStart& start, const InertialCalibration& calibration,
                 double weight);

  /// Adds the newest keyframe's state, predicted by the readings since the keyframe before. Call it after
  /// mapping::add_keyframe().
  void add_keyframe(const keyframes::Window& window, const inertial::Preintegration& since_last);
  /// Adds to the joint prior what marginalize_points() has added to the window's own prior.
  void add_to_prior(const Eigen::MatrixXd& H, const Eigen::VectorXd& b);
  /// Marginalises the keyframe with its velocity, its biases and the readings next to it. Call it before
  /// mapping::remove_keyframe().
  void remove_keyframe(const keyframes::Window& window, int slot);
  /// Linearises the newest keyframe's state anew. Call it after relinearize(); `moved`: what stacked_delta() lost by
  /// it.
  void relinearize_newest(const Eigen::VectorXd& moved);

  /// Returns the energy of the joint prior and of the readings, at the present state.
  double energy(const keyframes::Window& window) const;
  /// Solves for the step of all unknowns, given the window's photometric equations; damped as in optimize_window(), and
  /// without a part along the nullspace.
  Eigen::VectorXd solve(const NormalEquations& photometric, const keyframes::Window& window, double lambda) const;
  void save_state();
  /// Moves the saved state by `step`, which holds the unknowns behind the window's.
  void apply_step(const Eigen::VectorXd& step);
  void restore_state();

  /// Returns the joint system without the photometric residuals: prior and readings, at the present state. Unknowns:
  /// the window's, the world's (kWorldSize), then kKeyframeSize for each keyframe since the beginning, the oldest
  /// first.
  NormalEquations equations(const keyframes::Window& window) const;
  /// Returns the directions that nothing determines: the map's frame and scale, along which the world and the
  /// velocities follow.
  Eigen::MatrixXd nullspace(const keyframes::Window& window) const;
  int unknowns(const keyframes::Window& window) const {
    return window.unknowns() + kWorldSize + kKeyframeSize * static_cast<int>(states_.size());
  }

  /// Returns the state of the unit at the newest keyframe.
  inertial::ImuState newest_state(const keyframes::Window& window) const;
  /// Returns the pose of the camera in the map, for a state of the unit.
  geometry::SE3 T_camera_map(const inertial::ImuState& state) const;
  double log_scale() const { return world_linear_.log_scale + world_delta_[2]; }
  Eigen::Quaterniond R_world_map() const { return world().R_world_map; }
  /// Returns the squared normalised residual of the readings before the newest keyframe; of 9 degrees of freedom.
  double newest_residual(const keyframes::Window& window) const;

 private:
  using Vec9 = Eigen::Matrix<double, 9, 1>;
  struct World {
    Eigen::Quaterniond R_world_map;
    double log_scale = 0.0;
  };
  struct State {
    int keyframe = 0;  ///< id
    Vec9 linear = Vec9::Zero(), delta = Vec9::Zero(), backup = Vec9::Zero();
  };
  /// Readings from a keyframe to the next one, by id.
  struct Readings {
    int first = 0, second = 0;
    inertial::Preintegration between;
    inertial::Mat9 information;
    Vec9 walk_information;  ///< of the change of the biases; none of the velocity
  };
  /// A state of the unit, with its derivatives by the unknowns of its keyframe and of the world.
  struct StateDerivatives {
    Eigen::Matrix<double, inertial::kStateSize, 6> by_pose;
    Eigen::Matrix<double, inertial::kStateSize, kWorldSize> by_world;
  };

  World world() const;
  static int slot_of(const keyframes::Window& window, int id);
  int position_of(int id) const;
  inertial::ImuState state_at(const geometry::SE3& T_camera_map, const World& world, const Vec9& values) const;
  inertial::ImuState present(const keyframes::Window& window, int id) const;
  inertial::ImuState linearized(const keyframes::Window& window, int id) const;
  StateDerivatives derivatives(const keyframes::Window& window, int id) const;
  Eigen::VectorXd stacked(const keyframes::Window& window) const;
  void begin(const keyframes::Window& window, const InertialStart& start);
  void add_readings(const keyframes::Window& window, const Readings& readings, NormalEquations& sum) const;
  double readings_energy(const keyframes::Window& window, const Readings& readings) const;

  InertialCalibration calibration_;
  double weight_ = 1.0;
  World world_linear_;
  geometry::Vec3 world_delta_ = geometry::Vec3::Zero(), world_backup_ = geometry::Vec3::Zero();
  std::vector<State> states_;
  std::vector<Readings> readings_;
  NormalEquations prior_;  ///< delta^T H delta + 2 b^T delta over all unknowns
};

}  // namespace tileflight::mapping
