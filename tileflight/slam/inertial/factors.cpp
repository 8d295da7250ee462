#include "tileflight/slam/inertial/factors.h"

#include <cmath>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {

using geometry::Mat3;
using geometry::SE3;
using geometry::skew;
using geometry::Vec3;

LaterState moved_on(const ImuState& state, const MeanReading& reading, double later_s, double gravity_m_s2) {
  const Vec3 rate = reading.angular_rate_rad_s - state.bias.gyroscope_rad_s;
  const Vec3 force = reading.specific_force_m_s2 - state.bias.accelerometer_m_s2;
  const SE3& T = state.T_world_imu;
  const Vec3 acceleration = T.rotation * force - gravity_m_s2 * Vec3::UnitZ();
  const double half_square = 0.5 * later_s * later_s;
  const Eigen::Quaterniond turn = geometry::so3_exp(later_s * rate);
  const Mat3 R = T.rotation.toRotationMatrix();
  LaterState later;
  later.state = {SE3(T.rotation * turn, T.translation + later_s * state.velocity_m_s + half_square * acceleration),
                 state.velocity_m_s + later_s * acceleration, state.bias};
  later.by_state.setZero();
  later.by_state.block<3, 3>(0, kRotation) = turn.toRotationMatrix().transpose();
  later.by_state.block<3, 3>(0, kGyroscopeBias) = -later_s * geometry::so3_right_jacobian(later_s * rate);
  later.by_state.block<3, 3>(3, kRotation) = -half_square * R * skew(force);
  later.by_state.block<3, 3>(3, kPosition) = Mat3::Identity();
  later.by_state.block<3, 3>(3, kVelocity) = later_s * Mat3::Identity();
  later.by_state.block<3, 3>(3, kAccelerometerBias) = -half_square * R;
  later.by_time << rate, state.velocity_m_s + later_s * acceleration;
  return later;
}

VisualResidual visual_residual(const VisualStep& step, const ImuState& first, const ImuState& second,
                               const SE3& T_imu_camera, double log_scale) {
  const SE3 T_world_1 = first.T_world_imu * T_imu_camera, T_world_2 = second.T_world_imu * T_imu_camera;
  const double per_metre = std::exp(-log_scale);
  const SE3 T_12(T_world_1.rotation.conjugate() * T_world_2.rotation,
                 per_metre * (T_world_1.rotation.conjugate() * (T_world_2.translation - T_world_1.translation)));
  const Mat3 R_21 = step.T_first_second.rotation.toRotationMatrix().transpose();
  const Vec3 rotation = geometry::so3_log(step.T_first_second.rotation.conjugate() * T_12.rotation);
  VisualResidual r;
  r.value << R_21 * (T_12.translation - step.T_first_second.translation), rotation;

  r.by_first.setZero();
  r.by_second.setZero();
  const Mat3 J = geometry::so3_right_jacobian_inverse(rotation);
  const Mat3 R_camera_imu = T_imu_camera.rotation.toRotationMatrix().transpose();
  const Mat3 to_map = per_metre * R_21 * T_world_1.rotation.toRotationMatrix().transpose();
  const auto by_turning = [&](const ImuState& state) {  // the camera's place when the unit turns
    return Mat3(-state.T_world_imu.rotation.toRotationMatrix() * skew(T_imu_camera.translation));
  };
  const Mat3 translation_by_turn = R_21 * skew(T_12.translation),
             rotation_by_turn = -J * T_12.rotation.toRotationMatrix().transpose();
  r.by_first.block<3, 3>(0, kRotation) = translation_by_turn * R_camera_imu - to_map * by_turning(first);
  r.by_first.block<3, 3>(0, kPosition) = -to_map;
  r.by_first.block<3, 3>(3, kRotation) = rotation_by_turn * R_camera_imu;
  r.by_second.block<3, 3>(0, kRotation) = to_map * by_turning(second);
  r.by_second.block<3, 3>(0, kPosition) = to_map;
  r.by_second.block<3, 3>(3, kRotation) = J * R_camera_imu;
  r.by_log_scale << -R_21 * T_12.translation, Vec3::Zero();
  r.by_mounting << translation_by_turn, rotation_by_turn + J;
  return r;
}

using geometry::Mat3;
using geometry::skew;
using geometry::Vec3;

InertialResidual inertial_residual(const Preintegration& between, const ImuState& first, const ImuState& second,
                                   double gravity_m_s2) {
  const double dt = between.duration_s;
  const Vec3 g(0.0, 0.0, -gravity_m_s2);
  const Mat3 R1_t = first.T_world_imu.rotation.toRotationMatrix().transpose();
  const Vec3 velocity = R1_t * (second.velocity_m_s - first.velocity_m_s - dt * g);
  const Vec3 position = R1_t * (second.T_world_imu.translation - first.T_world_imu.translation -
                                dt * first.velocity_m_s - 0.5 * dt * dt * g);
  const Increment d = between.corrected(first.bias);
  const Eigen::Quaterniond R_12 = first.T_world_imu.rotation.conjugate() * second.T_world_imu.rotation;
  const Vec3 rotation = geometry::so3_log(d.rotation.conjugate() * R_12);
  InertialResidual r;
  r.value << rotation, velocity - d.velocity, position - d.position;

  r.by_first.setZero();
  r.by_second.setZero();
  const Mat3 J = geometry::so3_right_jacobian_inverse(rotation);
  const Mat3 rotation_by_bias = between.by_gyroscope_bias.topRows<3>();
  const Vec3 turned = rotation_by_bias * (first.bias.gyroscope_rad_s - between.bias.gyroscope_rad_s);
  r.by_first.block<3, 3>(0, kRotation) = -J * R_12.toRotationMatrix().transpose();
  r.by_first.block<3, 3>(0, kGyroscopeBias) = -J * geometry::so3_exp(rotation).toRotationMatrix().transpose() *
                                              geometry::so3_right_jacobian(turned) * rotation_by_bias;
  r.by_second.block<3, 3>(0, kRotation) = J;
  r.by_first.block<3, 3>(3, kRotation) = skew(velocity);
  r.by_first.block<3, 3>(3, kVelocity) = -R1_t;
  r.by_second.block<3, 3>(3, kVelocity) = R1_t;
  r.by_first.block<3, 3>(6, kRotation) = skew(position);
  r.by_first.block<3, 3>(6, kPosition) = -R1_t;
  r.by_first.block<3, 3>(6, kVelocity) = -dt * R1_t;
  r.by_second.block<3, 3>(6, kPosition) = R1_t;
  r.by_first.block<6, 3>(3, kGyroscopeBias) = -between.by_gyroscope_bias.bottomRows<6>();
  r.by_first.block<6, 3>(3, kAccelerometerBias) = -between.by_accelerometer_bias.bottomRows<6>();
  return r;
}

ImuState perturbed(const ImuState& state, const Eigen::Matrix<double, kStateSize, 1>& change) {
  return {geometry::SE3(state.T_world_imu.rotation * geometry::so3_exp(change.segment<3>(kRotation)),
                        state.T_world_imu.translation + change.segment<3>(kPosition)),
          state.velocity_m_s + change.segment<3>(kVelocity),
          {state.bias.gyroscope_rad_s + change.segment<3>(kGyroscopeBias),
           state.bias.accelerometer_m_s2 + change.segment<3>(kAccelerometerBias)}};
}

ImuState predicted(const Preintegration& between, const ImuState& first, double gravity_m_s2) {
  const double dt = between.duration_s;
  const Vec3 g(0.0, 0.0, -gravity_m_s2);
  const Increment d = between.corrected(first.bias);
  const geometry::SE3& T = first.T_world_imu;
  return {geometry::SE3(T.rotation * d.rotation,
                        T.translation + dt * first.velocity_m_s + 0.5 * dt * dt * g + T.rotation * d.position),
          first.velocity_m_s + dt * g + T.rotation * d.velocity, first.bias};
}

}  // namespace tileflight::inertial
