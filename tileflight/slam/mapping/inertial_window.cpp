#include "tileflight/slam/mapping/inertial_window.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "tileflight/core/geometry/decompositions.h"
#include "tileflight/slam/mapping/gauge.h"
#include "tileflight/slam/mapping/marginalization.h"

namespace tileflight::mapping {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using geometry::Mat3;
using geometry::SE3;
using geometry::skew;
using geometry::Vec3;
using inertial::ImuState;

// Densities for a unit without noise, as in the smoothing: its readings are linear between samples only so far.
constexpr double kLeastRateWalk = 1e-7, kLeastForceWalk = 1e-6;
constexpr double kLeastRateDensity = 1e-5, kLeastForceDensity = 1e-4;

double square(double x) { return x * x; }

/// Adds 2 b^T x + x^T H x of a residual with the derivative J.
void add_residual(const MatrixXd& J, const MatrixXd& information, const VectorXd& residual, NormalEquations& sum) {
  const MatrixXd weighted = J.transpose() * information;
  sum.H += weighted * J;
  sum.b += weighted * residual;
}

/// All numbers from 0 to `size` but `left_out`, which are in increasing order.
std::vector<int> others(int size, const std::vector<int>& left_out) {
  std::vector<int> all(static_cast<std::size_t>(size)), kept;
  std::iota(all.begin(), all.end(), 0);
  std::ranges::set_difference(all, left_out, std::back_inserter(kept));
  return kept;
}

void append_range(int begin, int count, std::vector<int>& list) {
  for (int i = 0; i < count; ++i) list.push_back(begin + i);
}

}  // namespace

// ---- states ----

InertialWindow::World InertialWindow::world() const {
  const Eigen::Quaterniond turn = geometry::so3_exp(Vec3(world_delta_[0], world_delta_[1], 0.0));
  return {turn * world_linear_.R_world_map, world_linear_.log_scale + world_delta_[2]};
}

int InertialWindow::slot_of(const keyframes::Window& window, int id) {
  const auto at = std::ranges::find(window.keyframes, id, &keyframes::Keyframe::id);
  return static_cast<int>(at - window.keyframes.begin());
}

int InertialWindow::position_of(int id) const {
  return static_cast<int>(std::ranges::find(states_, id, &State::keyframe) - states_.begin());
}

ImuState InertialWindow::state_at(const SE3& T_camera_map, const World& world, const Vec9& values) const {
  const SE3 T_map_camera = T_camera_map.inverse();
  const SE3 T_world_camera(world.R_world_map * T_map_camera.rotation,
                           std::exp(world.log_scale) * (world.R_world_map * T_map_camera.translation));
  return {
      T_world_camera * calibration_.T_imu_camera.inverse(), values.head<3>(), {values.segment<3>(3), values.tail<3>()}};
}

ImuState InertialWindow::present(const keyframes::Window& window, int id) const {
  const State& state = states_[static_cast<std::size_t>(position_of(id))];
  return state_at(window.keyframes[static_cast<std::size_t>(slot_of(window, id))].T_camera_map(), world(),
                  state.linear + state.delta);
}

ImuState InertialWindow::linearized(const keyframes::Window& window, int id) const {
  return state_at(window.keyframes[static_cast<std::size_t>(slot_of(window, id))].T_camera_map_linear, world_linear_,
                  states_[static_cast<std::size_t>(position_of(id))].linear);
}

ImuState InertialWindow::newest_state(const keyframes::Window& window) const {
  return present(window, states_.back().keyframe);
}

SE3 InertialWindow::T_camera_map(const ImuState& state) const {
  const World now = world();
  const SE3 T_world_camera = state.T_world_imu * calibration_.T_imu_camera;
  const Eigen::Quaterniond R_map_world = now.R_world_map.conjugate();
  return SE3(R_map_world * T_world_camera.rotation,
             std::exp(-now.log_scale) * (R_map_world * T_world_camera.translation))
      .inverse();
}

/// At the linearisation point. The pose's unknowns are a left twist of T_camera_map, which is a right one of the
/// camera's pose with the opposite sign; the world's tilt is a left rotation of R_world_map.
InertialWindow::StateDerivatives InertialWindow::derivatives(const keyframes::Window& window, int id) const {
  const SE3 T_map_camera =
      window.keyframes[static_cast<std::size_t>(slot_of(window, id))].T_camera_map_linear.inverse();
  const double scale = std::exp(world_linear_.log_scale);
  const SE3 T_camera_imu = calibration_.T_imu_camera.inverse();
  const Mat3 R_world_camera = (world_linear_.R_world_map * T_map_camera.rotation).toRotationMatrix();
  const ImuState state = linearized(window, id);
  const Mat3 R_imu_world = state.T_world_imu.rotation.toRotationMatrix().transpose();
  StateDerivatives d;
  d.by_pose.setZero();
  d.by_pose.block<3, 3>(inertial::kRotation, 3) = -calibration_.T_imu_camera.rotation.toRotationMatrix();
  d.by_pose.block<3, 3>(inertial::kPosition, 0) = -scale * R_world_camera;
  d.by_pose.block<3, 3>(inertial::kPosition, 3) = R_world_camera * skew(T_camera_imu.translation);
  d.by_world.setZero();
  d.by_world.block<3, 2>(inertial::kRotation, 0) = R_imu_world.leftCols<2>();
  d.by_world.block<3, 2>(inertial::kPosition, 0) = -skew(state.T_world_imu.translation).leftCols<2>();
  d.by_world.block<3, 1>(inertial::kPosition, 2) = scale * (world_linear_.R_world_map * T_map_camera.translation);
  return d;
}

VectorXd InertialWindow::stacked(const keyframes::Window& window) const {
  VectorXd delta(unknowns(window));
  delta.head(window.unknowns()) = stacked_delta(window);
  delta.segment<kWorldSize>(window.unknowns()) = world_delta_;
  for (std::size_t i = 0; i < states_.size(); ++i)
    delta.segment<kKeyframeSize>(window.unknowns() + kWorldSize + kKeyframeSize * static_cast<int>(i)) =
        states_[i].delta;
  return delta;
}

// ---- prior ----

InertialWindow::InertialWindow(const keyframes::Window& window, const InertialStart& start,
                               const InertialCalibration& calibration, double weight)
    : calibration_(calibration), weight_(weight), world_linear_{start.R_world_map, start.log_scale} {
  inertial::ImuNoise& noise = calibration_.noise;
  noise.gyroscope_random_walk = std::max(noise.gyroscope_random_walk, kLeastRateWalk);
  noise.accelerometer_random_walk = std::max(noise.accelerometer_random_walk, kLeastForceWalk);
  State newest{.keyframe = window.keyframes.back().id};
  newest.linear << start.velocity_m_s, start.bias.gyroscope_rad_s, start.bias.accelerometer_m_s2;
  states_.push_back(newest);
  const int n = window.unknowns(), size = unknowns(window);
  prior_ = {MatrixXd::Zero(size, size), VectorXd::Zero(size)};
  prior_.H.topLeftCorner(n, n) = window.H_prior;
  prior_.b.head(n) = window.b_prior;
  begin(window, start);
}

/// Makes a prior of tilt, scale, velocity and biases at the newest keyframe, in quantities that do not depend
/// on the map's frame and scale nor on the world's heading: the tilt of the unit, the velocity in its axes, and the
/// distance in metres from the window's oldest keyframe.
void InertialWindow::begin(const keyframes::Window& window, const InertialStart& start) {
  const int newest = window.size() - 1, n = window.unknowns(), own = n + kWorldSize;
  const StateDerivatives d = derivatives(window, states_.front().keyframe);
  const ImuState state = linearized(window, states_.front().keyframe);
  const Mat3 R = state.T_world_imu.rotation.toRotationMatrix();
  MatrixXd J = MatrixXd::Zero(12, unknowns(window));
  const auto turned = [&](const Mat3& by_rotation, int row, int rows) {
    J.block(row, 8 * newest, rows, 6) = by_rotation.topRows(rows) * d.by_pose.topRows<3>();
    J.block(row, n, rows, kWorldSize) = by_rotation.topRows(rows) * d.by_world.topRows<3>();
  };
  turned(R, 0, 2);
  const auto centre = [&](int slot) {
    return window.keyframes[static_cast<std::size_t>(slot)].T_camera_map_linear.inverse();
  };
  const Vec3 baseline = centre(newest).translation - centre(0).translation;
  J(2, n + 2) = 1.0;
  for (const int slot : {0, newest}) {
    const double sign = slot == newest ? -1.0 : 1.0;  // a centre moves by -R_map_camera times the twist's translation
    J.block<1, 3>(2, 8 * slot) =
        sign / baseline.squaredNorm() * baseline.transpose() * centre(slot).rotation.toRotationMatrix();
  }
  turned(skew(R.transpose() * start.velocity_m_s), 3, 3);
  J.block<3, 3>(3, own) = R.transpose();
  J.block<6, 6>(6, own + 3).setIdentity();
  add_residual(J, weight_ * geometry::symmetric_inverse(start.covariance), VectorXd::Zero(12), prior_);
}

void InertialWindow::add_keyframe(const keyframes::Window& window, const inertial::Preintegration& since_last) {
  // Grows the prior: the window put the keyframe's eight unknowns behind those of the other keyframes, and those of its
  // stereo pictures behind the rest.
  const int n = window.unknowns(), poses = 8 * window.size();
  std::vector<int> added;
  append_range(poses - 8, 8, added);
  if (window.has_stereo()) append_range(n - 8, 8, added);
  const ImuState before = present(window, states_.back().keyframe);
  const ImuState state = inertial::predicted(since_last, before, calibration_.gravity_m_s2);
  State newest{.keyframe = window.keyframes.back().id};
  newest.linear << state.velocity_m_s, state.bias.gyroscope_rad_s, state.bias.accelerometer_m_s2;
  const int last = states_.back().keyframe;
  states_.push_back(newest);
  NormalEquations grown{MatrixXd::Zero(unknowns(window), unknowns(window)), VectorXd::Zero(unknowns(window))};
  for (const int i : added) grown.b[i] = window.b_prior[i], grown.H(i, i) = window.H_prior(i, i);
  std::vector<int> kept = others(unknowns(window) - kKeyframeSize, added);
  grown.H(kept, kept) = prior_.H;
  grown.b(kept) = prior_.b;
  prior_ = std::move(grown);

  Readings readings{
      .first = last, .second = newest.keyframe, .between = since_last, .information = {}, .walk_information = {}};
  inertial::Mat9 covariance = since_last.covariance;
  const double dt = since_last.duration_s;
  covariance.diagonal().head<3>().array() += square(kLeastRateDensity) * dt;
  covariance.diagonal().segment<3>(3).array() += square(kLeastForceDensity) * dt;
  covariance.diagonal().tail<3>().array() += square(kLeastForceDensity) * dt * dt * dt / 3.0;
  readings.information = weight_ * covariance.ldlt().solve(inertial::Mat9::Identity());
  const double rate = weight_ / (square(calibration_.noise.gyroscope_random_walk) * dt),
               force = weight_ / (square(calibration_.noise.accelerometer_random_walk) * dt);
  readings.walk_information << Vec3::Zero(), Vec3::Constant(rate), Vec3::Constant(force);
  readings_.push_back(readings);
}

void InertialWindow::add_to_prior(const MatrixXd& H, const VectorXd& b) {
  prior_.H.topLeftCorner(H.rows(), H.cols()) += H;
  prior_.b.head(b.size()) += b;
}

void InertialWindow::remove_keyframe(const keyframes::Window& window, int slot) {
  const int id = window.keyframes[static_cast<std::size_t>(slot)].id;
  NormalEquations sum{MatrixXd::Zero(unknowns(window), unknowns(window)), VectorXd::Zero(unknowns(window))};
  for (const Readings& readings : readings_) {
    if (readings.first == id || readings.second == id) add_readings(window, readings, sum);
  }
  std::erase_if(readings_, [id](const Readings& r) { return r.first == id || r.second == id; });
  prior_.H += sum.H;
  prior_.b += sum.b - sum.H * stacked(window);  // to the linearisation point
  std::vector<int> leaving;
  append_range(8 * slot, 8, leaving);
  if (window.has_stereo()) append_range(window.stereo_unknown(slot), 8, leaving);
  const int position = position_of(id);
  if (position < static_cast<int>(states_.size())) {
    append_range(window.unknowns() + kWorldSize + kKeyframeSize * position, kKeyframeSize, leaving);
    states_.erase(states_.begin() + position);
  }
  const QuadraticPrior left = marginalize_unknowns({prior_.H, prior_.b}, leaving);
  prior_ = {left.H, left.b};
}

void InertialWindow::relinearize_newest(const VectorXd& moved) {
  State& newest = states_.back();
  prior_.b += prior_.H.leftCols(moved.size()) * moved + prior_.H.rightCols<kKeyframeSize>() * newest.delta;
  newest.linear += newest.delta;
  newest.delta.setZero();
}

// ---- equations ----

void InertialWindow::add_readings(const keyframes::Window& window, const Readings& readings,
                                  NormalEquations& sum) const {
  const ImuState first = present(window, readings.first), second = present(window, readings.second);
  const inertial::InertialResidual linear =
      inertial::inertial_residual(readings.between, linearized(window, readings.first),
                                  linearized(window, readings.second), calibration_.gravity_m_s2);
  const VectorXd residual =
      inertial::inertial_residual(readings.between, first, second, calibration_.gravity_m_s2).value;
  // Only the unknowns of both keyframes and of the world: pose, own, pose, own, world.
  constexpr int kEach = 6 + kKeyframeSize, kWorld = 2 * kEach;
  const int n = window.unknowns();
  std::vector<int> columns;
  Eigen::Matrix<double, 9, kWorld + kWorldSize> J, walk = decltype(J)::Zero();
  J.rightCols<kWorldSize>().setZero();
  const auto add = [&](int which, int id, const inertial::Mat915& by_state, double sign) {
    const StateDerivatives d = derivatives(window, id);
    append_range(8 * slot_of(window, id), 6, columns);
    append_range(n + kWorldSize + kKeyframeSize * position_of(id), kKeyframeSize, columns);
    J.middleCols<6>(kEach * which) = by_state * d.by_pose;
    J.middleCols<kKeyframeSize>(kEach * which + 6) = by_state.rightCols<kKeyframeSize>();
    J.rightCols<kWorldSize>() += by_state * d.by_world;
    walk.middleCols<kKeyframeSize>(kEach * which + 6).diagonal().setConstant(sign);
  };
  add(0, readings.first, linear.by_first, -1.0);
  add(1, readings.second, linear.by_second, 1.0);
  append_range(n, kWorldSize, columns);
  Vec9 change;
  change << Vec3::Zero(), second.bias.gyroscope_rad_s - first.bias.gyroscope_rad_s,
      second.bias.accelerometer_m_s2 - first.bias.accelerometer_m_s2;
  NormalEquations both{MatrixXd::Zero(J.cols(), J.cols()), VectorXd::Zero(J.cols())};
  add_residual(J, readings.information, residual, both);
  add_residual(walk, readings.walk_information.asDiagonal().toDenseMatrix(), change, both);
  sum.H(columns, columns) += both.H;
  sum.b(columns) += both.b;
}

double InertialWindow::readings_energy(const keyframes::Window& window, const Readings& readings) const {
  const ImuState first = present(window, readings.first), second = present(window, readings.second);
  const auto r = inertial::inertial_residual(readings.between, first, second, calibration_.gravity_m_s2).value;
  Vec9 change;
  change << Vec3::Zero(), second.bias.gyroscope_rad_s - first.bias.gyroscope_rad_s,
      second.bias.accelerometer_m_s2 - first.bias.accelerometer_m_s2;
  return r.dot(readings.information * r) + change.dot(readings.walk_information.cwiseProduct(change));
}

double InertialWindow::newest_residual(const keyframes::Window& window) const {
  return readings_.empty() ? 0.0 : readings_energy(window, readings_.back()) / weight_;
}

NormalEquations InertialWindow::equations(const keyframes::Window& window) const {
  NormalEquations sum{prior_.H, prior_.b + prior_.H * stacked(window)};
  for (const Readings& readings : readings_) add_readings(window, readings, sum);
  return sum;
}

double InertialWindow::energy(const keyframes::Window& window) const {
  const VectorXd delta = stacked(window);
  double sum = delta.dot(prior_.H * delta) + 2.0 * prior_.b.dot(delta);
  for (const Readings& readings : readings_) sum += readings_energy(window, readings);
  return sum;
}

MatrixXd InertialWindow::nullspace(const keyframes::Window& window) const {
  const MatrixXd map = gauge_nullspace(window);
  const int n = window.unknowns();
  MatrixXd N = MatrixXd::Zero(unknowns(window), map.cols());
  N.topRows(n) = map;
  // A rotation of the map by e turns the world's axes by R e: tilt makes up for it, heading does not, and turns the
  // velocities.
  const Mat3 R = world_linear_.R_world_map.toRotationMatrix();
  N.block<2, 3>(n, 3) = -R.topRows<2>();
  for (std::size_t i = 0; i < states_.size(); ++i)
    N.block<3, 3>(n + kWorldSize + kKeyframeSize * static_cast<int>(i), 3) =
        Vec3::UnitZ().cross(states_[i].linear.head<3>()) * R.row(2);
  if (map.cols() > 6) N(n + 2, 6) = -1.0;
  return N;
}

VectorXd InertialWindow::solve(const NormalEquations& photometric, const keyframes::Window& window,
                               double lambda) const {
  const int n = window.unknowns();
  NormalEquations sum = equations(window);
  sum.H.topLeftCorner(n, n) += photometric.H;
  sum.b.head(n) += photometric.b;
  // This solves as solve_damped() of window_optimizer.cpp does. Scale, tilt, velocities and biases are strongly tied to
  // each other: what all of them together leave open is far below the damping, which is for the window's unknowns only.
  const VectorXd scale = (sum.H.diagonal().array().max(0.0) + 10.0).sqrt().inverse();
  MatrixXd H = scale.asDiagonal() * sum.H * scale.asDiagonal();
  H.diagonal().head(n).array() += lambda;
  H.diagonal().tail(unknowns(window) - n).array() += 1e-12;
  const VectorXd x = -(scale.asDiagonal() * geometry::solve_symmetric(H, scale.asDiagonal() * sum.b));
  const VectorXd inverse_scale = scale.cwiseInverse();
  const MatrixXd N = inverse_scale.asDiagonal() * nullspace(window);
  return scale.asDiagonal() * remove_gauge_component(inverse_scale.asDiagonal() * x, N);
}

void InertialWindow::save_state() {
  world_backup_ = world_delta_;
  for (State& state : states_) state.backup = state.delta;
}

void InertialWindow::apply_step(const VectorXd& step) {
  world_delta_ = world_backup_ + step.head<kWorldSize>();
  for (std::size_t i = 0; i < states_.size(); ++i)
    states_[i].delta =
        states_[i].backup + step.segment<kKeyframeSize>(kWorldSize + kKeyframeSize * static_cast<int>(i));
}

void InertialWindow::restore_state() {
  world_delta_ = world_backup_;
  for (State& state : states_) state.delta = state.backup;
}

}  // namespace tileflight::mapping
