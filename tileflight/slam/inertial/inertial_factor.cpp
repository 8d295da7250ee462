#include "tileflight/slam/inertial/inertial_factor.h"

#include "tileflight/core/geometry/transform.h"

namespace tileflight::inertial {

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
