#include "tileflight/slam/inertial/inertial_start.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace tileflight::inertial {
namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

Eigen::Quaterniond R_map_imu(const VisualInertialProblem& problem, std::size_t k) {
  return problem.keyframes()[k].T_map_camera.rotation * problem.model().T_imu_camera.rotation.conjugate();
}

/// Least squares for the bias that turns the samples as the camera turned; two Gauss-Newton steps.
geometry::ImuBias gyroscope_bias(const VisualInertialProblem& problem, double time_offset_s) {
  geometry::ImuBias bias;
  for (int iteration = 0; iteration < 2; ++iteration) {
    Mat3 H = 1e-9 * Mat3::Identity();
    Vec3 b = Vec3::Zero();
    for (std::size_t k = 0; k + 1 < problem.keyframes().size(); ++k) {
      const auto between = problem.preintegrate_step(k, time_offset_s, bias);
      if (!between) continue;
      const Vec3 residual = geometry::so3_log(between->increment.rotation.conjugate() *
                                              R_map_imu(problem, k).conjugate() * R_map_imu(problem, k + 1));
      const Mat3 J = between->by_gyroscope_bias.topRows<3>();
      H += J.transpose() * J;
      b += J.transpose() * residual;
    }
    bias.gyroscope_rad_s += H.ldlt().solve(b);
  }
  return bias;
}

/// Joins the increments of two intervals that follow each other.
Increment joined(const Increment& a, const Increment& b, double b_duration_s) {
  return {a.rotation * b.rotation, a.velocity + a.rotation * b.velocity,
          a.position + b_duration_s * a.velocity + a.rotation * b.position};
}

/// Motion from keyframe `first` to `last`, rotated into the map's axes.
struct LongStep {
  std::size_t first = 0, last = 0;
  double duration_s = 0.0;
  Vec3 velocity = Vec3::Zero(), position = Vec3::Zero();
};

/// Steps of at least `spacing_s`, one after the other; where samples are missing, the next begins behind.
std::vector<LongStep> long_steps(const VisualInertialProblem& problem, double time_offset_s,
                                 const geometry::ImuBias& bias, double spacing_s) {
  std::vector<LongStep> steps;
  std::size_t first = 0;
  Increment sum;
  double duration_s = 0.0;
  const auto begin_at = [&](std::size_t k) { first = k, sum = {}, duration_s = 0.0; };
  for (std::size_t k = 0; k + 1 < problem.keyframes().size(); ++k) {
    const auto between = problem.preintegrate_step(k, time_offset_s, bias);
    if (!between) {
      begin_at(k + 1);
      continue;
    }
    sum = joined(sum, between->increment, between->duration_s);
    duration_s += between->duration_s;
    if (duration_s < spacing_s) continue;
    const Eigen::Quaterniond R = R_map_imu(problem, first);
    steps.push_back({first, k + 1, duration_s, R * sum.velocity, R * sum.position});
    begin_at(k + 1);
  }
  return steps;
}

/// Scale, and gravity in the map's axes.
struct ScaleAndGravity {
  double scale = 0.0;
  Vec3 gravity_m_s2 = Vec3::Zero();
};

std::optional<ScaleAndGravity> solve_triples(const VisualInertialProblem& problem, const std::vector<LongStep>& steps) {
  constexpr std::size_t kFewest = 2;  // six equations for four unknowns
  const auto camera = [&](std::size_t k) { return problem.keyframes()[k].T_map_camera.translation; };
  const auto lever = [&](std::size_t k) {
    return Vec3(R_map_imu(problem, k) * problem.model().T_imu_camera.translation);
  };
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d b = Eigen::Vector4d::Zero();
  std::size_t triples = 0;
  for (std::size_t n = 0; n + 1 < steps.size(); ++n) {
    const LongStep &one = steps[n], &two = steps[n + 1];
    if (one.last != two.first) continue;
    const auto difference = [&](const auto& place) {  // of the mean velocities of both steps
      return Vec3((place(two.last) - place(two.first)) / two.duration_s -
                  (place(one.last) - place(one.first)) / one.duration_s);
    };
    Eigen::Matrix<double, 3, 4> A;  // the unit is at scale * camera - lever
    A << difference(camera), -0.5 * (one.duration_s + two.duration_s) * Mat3::Identity();
    const Vec3 y = difference(lever) + one.velocity + two.position / two.duration_s - one.position / one.duration_s;
    H += A.transpose() * A;
    b += A.transpose() * y;
    ++triples;
  }
  if (problem.keyframes().front().is_metric) {  // the scale is one
    if (triples == 0) return std::nullopt;
    const double gravity_scale = H.bottomRightCorner<3, 3>().trace(), known = 1e9 * (H(0, 0) + gravity_scale);
    H(0, 0) += known;
    b[0] += known;
  } else if (triples < kFewest) {
    return std::nullopt;
  }
  const Eigen::Vector4d x = H.completeOrthogonalDecomposition().solve(b);
  if (!(x[0] > 0.0) || !(x.tail<3>().norm() > 0.0)) return std::nullopt;
  return ScaleAndGravity{x[0], x.tail<3>()};
}

/// States at the keyframes for a scale and a direction of gravity.
VisualInertialState make_states(const VisualInertialProblem& problem, const ScaleAndGravity& found,
                                double time_offset_s, const geometry::ImuBias& bias) {
  const auto& keyframes = problem.keyframes();
  const Eigen::Quaterniond R_world_map =
      Eigen::Quaterniond::FromTwoVectors(-found.gravity_m_s2.normalized(), Vec3::UnitZ());
  VisualInertialState start;
  start.T_imu_camera = problem.model().T_imu_camera;
  start.time_offset_s = time_offset_s;
  start.log_scale.assign(keyframes.size(), std::log(found.scale));
  for (const VisualKeyframe& keyframe : keyframes) {
    const SE3 T_world_camera(R_world_map * keyframe.T_map_camera.rotation,
                             found.scale * (R_world_map * keyframe.T_map_camera.translation));
    start.states.push_back({T_world_camera * start.T_imu_camera.inverse(), Vec3::Zero(), bias});
  }
  for (std::size_t k = 0; k < keyframes.size(); ++k) {  // the mean velocity of the step, corrected to its end
    const std::size_t a = k + 1 < keyframes.size() ? k : k - 1;
    const double dt = keyframes[a + 1].time_s - keyframes[a].time_s;
    start.states[k].velocity_m_s =
        (start.states[a + 1].T_world_imu.translation - start.states[a].T_world_imu.translation) / dt;
  }
  return start;
}

}  // namespace

std::optional<VisualInertialState> inertial_start(const VisualInertialProblem& problem, double time_offset_s,
                                                  double spacing_s) {
  const auto& keyframes = problem.keyframes();
  if (keyframes.size() < 3) return std::nullopt;
  if (keyframes.front().is_metric)  // gravity alone shows in less time
    spacing_s = std::min(spacing_s, 0.3 * (keyframes.back().time_s - keyframes.front().time_s));
  const geometry::ImuBias bias = gyroscope_bias(problem, time_offset_s);
  const auto found = solve_triples(problem, long_steps(problem, time_offset_s, bias, spacing_s));
  if (!found) return std::nullopt;
  return make_states(problem, *found, time_offset_s, bias);
}

}  // namespace tileflight::inertial
