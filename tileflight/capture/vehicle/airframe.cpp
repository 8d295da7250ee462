#include "tileflight/capture/vehicle/airframe.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tileflight::vehicle {
namespace {

using geometry::Vec3;

constexpr double kArm_m = 0.2275, kRotorHeight_m = 0.025, kPropellerRadius_m = 0.1143;
constexpr double kMotor_kg = 0.055, kBoxPerRotor_kg = 0.195;
const Vec3 kBox_m(0.18, 0.11, 0.04);
constexpr double kFeet_m = 0.15, kTop_m = 0.1;

/// Bearing of an arm, degrees clockwise from forward, and the rotor's spin.
struct Arm {
  double bearing_deg;
  double spin;
};

constexpr double kCcw = 1.0, kCw = -1.0;

std::vector<Arm> arms_of(AirframeKind kind) {
  if (kind == AirframeKind::kQuadX) return {{45, kCcw}, {-135, kCcw}, {-45, kCw}, {135, kCw}};
  return {{90, kCw}, {-90, kCcw}, {-30, kCw}, {150, kCcw}, {30, kCcw}, {-150, kCw}};
}

Vec3 along_arm(const Arm& arm, double distance_m) {
  const double bearing_rad = arm.bearing_deg * std::numbers::pi / 180.0;
  return {distance_m * std::cos(bearing_rad), -distance_m * std::sin(bearing_rad), kRotorHeight_m};
}

/// Mass and inertia of a solid box and of point masses for the motors.
RigidBody body_of(const std::vector<Rotor>& rotors) {
  const double box_kg = kBoxPerRotor_kg * static_cast<double>(rotors.size());
  const Vec3 squares = kBox_m.cwiseProduct(kBox_m);
  geometry::Mat3 inertia = (box_kg / 12.0 * (Vec3::Constant(squares.sum()) - squares)).asDiagonal();
  for (const Rotor& rotor : rotors) {
    const Vec3& r = rotor.position_m;
    inertia += kMotor_kg * (r.squaredNorm() * geometry::Mat3::Identity() - r * r.transpose());
  }
  return {box_kg + kMotor_kg * static_cast<double>(rotors.size()), inertia};
}

}  // namespace

Wrench multirotor_wrench(const MultirotorOptions& options, const RigidBodyState& state,
                         std::span<const double> speeds_rad_s, const Vec3& wind_m_s) {
  const Vec3 through_air = state.R_local_body.conjugate() * (state.velocity_m_s - wind_m_s);
  Vec3 force = -(options.linear_drag_n_s_m.cwiseProduct(through_air) +
                 options.quadratic_drag_n_s2_m2.cwiseProduct(through_air.cwiseAbs().cwiseProduct(through_air)));
  Vec3 torque = Vec3::Zero();
  for (std::size_t i = 0; i < options.rotors.size(); ++i) {
    const Rotor& rotor = options.rotors[i];
    const double squared = speeds_rad_s[i] * speeds_rad_s[i];
    const Vec3 thrust(0, 0, options.thrust_n_s2 * squared);
    force += thrust;
    torque += rotor.position_m.cross(thrust) - Vec3(0, 0, rotor.spin * options.torque_nm_s2 * squared);
  }
  return {state.R_local_body * force - Vec3(0, 0, options.body.mass_kg * kStandardGravity_m_s2), torque};
}

Airframe make_airframe(AirframeKind kind) {
  Airframe frame;
  frame.rotors.clear();
  for (const double x : {kFeet_m, -kFeet_m})
    for (const double y : {kFeet_m, -kFeet_m}) frame.contact_points_m.emplace_back(x, y, -kStandingHeight_m);
  for (const Arm& arm : arms_of(kind)) {
    frame.rotors.push_back({along_arm(arm, kArm_m), arm.spin});
    frame.contact_points_m.push_back(along_arm(arm, kArm_m + kPropellerRadius_m));
  }
  frame.contact_points_m.emplace_back(0.0, 0.0, kTop_m);
  frame.body = body_of(frame.rotors);
  frame.contact.stiffness_n_m *= frame.body.mass_kg;
  frame.contact.damping_n_s_m *= frame.body.mass_kg;
  return frame;
}

double thrust_share(double output, double expo) {
  if (std::isnan(output)) return 0.0;
  const double u = std::clamp(output, 0.0, 1.0);
  return (1.0 - expo) * u + expo * u * u;
}

}  // namespace tileflight::vehicle
