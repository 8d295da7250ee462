#include "tileflight/capture/vehicle/multirotor.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tileflight::vehicle {
namespace {

using geometry::Vec3;
using vehicle::RigidBodyState;
using vehicle::Wrench;

constexpr double kMaxPart_s = 0.001;
/// Settling on the ground: at most this long, until slower than this.
constexpr double kMaxSettling_s = 5.0, kAtRest_m_s = 1e-5;
constexpr double kMaxDrop_m = 10.0;
constexpr std::size_t kFeet = 4;
/// Its feet are let go this far above the ground, on ground of at most 45 degrees.
constexpr double kDrop_m = 0.005, kMinUp = 0.7;
const Vec3 kGravity_m_s2(0.0, 0.0, -vehicle::kStandardGravity_m_s2);

Vec3 point_of(const RigidBodyState& body, const Vec3& offset) { return body.position_m + body.R_local_body * offset; }

Vec3 velocity_of(const RigidBodyState& body, const Vec3& offset) {
  return body.velocity_m_s + body.R_local_body * body.angular_velocity_rad_s.cross(offset);
}

Vec3 across(const Vec3& v, const Vec3& normal) { return v - normal.dot(v) * normal; }

}  // namespace

Multirotor::Multirotor(Airframe airframe, vehicle::ObstacleQuery obstacles, const vehicle::WindOptions& wind,
                       const Vec3& position_m, double yaw_rad)
    : airframe_(std::move(airframe)),
      obstacles_(std::move(obstacles)),
      wind_options_(wind),
      now_{.body = {},
           .rotor_speeds_rad_s = std::vector<double>(airframe_.rotors.size(), 0.0),
           .touches = std::vector<Touch>(airframe_.contact_points_m.size()),
           .wind = vehicle::Wind({}),
           .inertial = {},
           .impact = {}},
      start_(now_) {
  now_.body.position_m = position_m;
  now_.body.R_local_body = vehicle::level_orientation(yaw_rad);
  const bool on_ground = put_down(yaw_rad);
  if (on_ground) settle();
  now_.body.velocity_m_s.setZero();
  now_.body.angular_velocity_rad_s.setZero();
  now_.inertial = {Vec3::Zero(), on_ground ? Vec3(now_.body.R_local_body.conjugate() * -kGravity_m_s2) : Vec3::Zero()};
  now_.impact.reset();
  start_ = now_;
  reset();
}

bool Multirotor::put_down(double yaw_rad) {
  if (!obstacles_) return false;
  std::vector<Vec3> ground;
  for (std::size_t foot = 0; foot < kFeet; ++foot) {
    Vec3 above = point_of(now_.body, airframe_.contact_points_m[foot]);
    above.z() = now_.body.position_m.z();
    const auto hit = obstacles_(above, above - Vec3(0, 0, kMaxDrop_m));
    if (hit) ground.push_back(hit->point);
  }
  if (ground.size() < kFeet) return false;
  Vec3 up = (ground[0] - ground[3]).cross(ground[2] - ground[1]).normalized();  // of the diagonals
  if (up.z() < 0.0) up = -up;
  if (up.z() < kMinUp) up = Vec3::UnitZ();
  const Vec3 middle = (ground[0] + ground[1] + ground[2] + ground[3]) / 4.0;
  now_.body.position_m = middle + (kStandingHeight_m + kDrop_m) * up;
  now_.body.R_local_body = Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), up) * vehicle::level_orientation(yaw_rad);
  return true;
}

/// In still air: its start must not depend on a gust.
void Multirotor::settle() {
  const std::vector<double> off(airframe_.rotors.size(), 0.0);
  constexpr int kQuietParts = 100;
  int quiet = 0;
  for (int i = 0; i * kMaxPart_s < kMaxSettling_s && quiet < kQuietParts; ++i) {
    step_part(off, kMaxPart_s);
    const double fastest = std::max(now_.body.velocity_m_s.norm(), now_.body.angular_velocity_rad_s.norm());
    quiet = touching() && fastest < kAtRest_m_s ? quiet + 1 : 0;
  }
}

void Multirotor::reset() {
  now_ = start_;
  now_.wind = vehicle::Wind(wind_options_);
}

void Multirotor::place(const RigidBodyState& body) {
  now_.body = body;
  std::ranges::fill(now_.touches, Touch{});
}

void Multirotor::set_wind(const Vec3& mean_m_s) {
  wind_options_.mean_m_s = mean_m_s;
  now_.wind.set_mean(mean_m_s);
}

bool Multirotor::touching() const { return std::ranges::any_of(now_.touches, &Touch::active); }

void Multirotor::step(std::span<const double> thrust_shares, double step_s) {
  std::vector<double> targets_rad_s(airframe_.rotors.size(), 0.0);
  for (std::size_t i = 0; i < std::min(targets_rad_s.size(), thrust_shares.size()); ++i)
    targets_rad_s[i] = airframe_.max_rotor_speed_rad_s * std::sqrt(std::clamp(thrust_shares[i], 0.0, 1.0));
  const int parts = std::max(1, static_cast<int>(std::ceil(step_s / kMaxPart_s - 1e-9)));
  const Vec3 from = now_.body.position_m;
  InertialReading mean;
  now_.impact.reset();
  for (int i = 0; i < parts; ++i) {
    const RigidBodyState before = now_.body;
    step_part(targets_rad_s, step_s / parts);
    if (i + 1 == parts) keep_hull_out(from);
    const Vec3 gained = now_.body.velocity_m_s - before.velocity_m_s - kGravity_m_s2 * (step_s / parts);
    const Eigen::Quaterniond midway = before.R_local_body.slerp(0.5, now_.body.R_local_body);
    mean.accelerometer_m_s2 += midway.conjugate() * gained / step_s;
    mean.gyro_rad_s += 0.5 * (before.angular_velocity_rad_s + now_.body.angular_velocity_rad_s) / parts;
  }
  now_.inertial = mean;
}

void Multirotor::step_part(std::span<const double> targets_rad_s, double step_s) {
  now_.wind.advance(step_s, now_.body.velocity_m_s);
  find_touches();
  const std::vector<double> before = now_.rotor_speeds_rad_s;
  std::vector<double> speeds = before;
  const auto speeds_at = [&](double time_s) -> const std::vector<double>& {
    const double left = std::exp(-time_s / airframe_.motor_time_constant_s);
    for (std::size_t i = 0; i < speeds.size(); ++i)
      speeds[i] = targets_rad_s[i] + (before[i] - targets_rad_s[i]) * left;
    return speeds;
  };
  now_.body = vehicle::integrate(airframe_.body, now_.body, step_s, [&](const RigidBodyState& body, double time_s) {
    const Wrench flying = vehicle::multirotor_wrench(airframe_, body, speeds_at(time_s), now_.wind.velocity_m_s());
    const Wrench contact = contact_wrench(body);
    return Wrench{flying.force_n + contact.force_n, flying.torque_nm + contact.torque_nm};
  });
  now_.rotor_speeds_rad_s = speeds_at(step_s);
  slide_anchors();
}

/// The plane of the surface between the centre of mass and each contact point; over one part of a step it is constant.
void Multirotor::find_touches() {
  if (!obstacles_) return;
  for (std::size_t i = 0; i < now_.touches.size(); ++i) {
    Touch& touch = now_.touches[i];
    const Vec3& offset = airframe_.contact_points_m[i];
    const Vec3 point = point_of(now_.body, offset);
    const auto hit = obstacles_(now_.body.position_m, point);
    if (!hit) {
      touch.active = false;
      continue;
    }
    const bool facing = hit->normal.dot(now_.body.position_m - hit->point) >= 0.0;
    touch.normal = facing ? hit->normal : Vec3(-hit->normal);
    touch.plane_point = hit->point;
    if (!touch.active) {
      touch.anchor = point;
      record_impact(hit->point, touch.normal, velocity_of(now_.body, offset));
    }
    touch.active = true;
  }
}

void Multirotor::record_impact(const Vec3& point, const Vec3& normal, const Vec3& velocity_m_s) {
  const double speed_m_s = -normal.dot(velocity_m_s);
  if (!now_.impact || speed_m_s > now_.impact->speed_m_s) now_.impact = Impact{point, normal, speed_m_s};
}

Vec3 Multirotor::friction_n(const Touch& touch, const Vec3& point, const Vec3& velocity_m_s, double normal_n) const {
  const ContactOptions& contact = airframe_.contact;
  const Vec3 sticking = -contact.stiffness_n_m * across(point - touch.anchor, touch.normal) -
                        contact.damping_n_s_m * across(velocity_m_s, touch.normal);
  const double most_n = contact.friction * normal_n, wanted_n = sticking.norm();
  return wanted_n > most_n ? Vec3(sticking * (most_n / wanted_n)) : sticking;
}

Wrench Multirotor::contact_wrench(const RigidBodyState& body) const {
  const ContactOptions& contact = airframe_.contact;
  Wrench sum;
  for (std::size_t i = 0; i < now_.touches.size(); ++i) {
    const Touch& touch = now_.touches[i];
    if (!touch.active) continue;
    const Vec3& offset = airframe_.contact_points_m[i];
    const Vec3 point = point_of(body, offset), velocity_m_s = velocity_of(body, offset);
    const double depth_m = touch.normal.dot(touch.plane_point - point);
    const double normal_n =
        std::max(0.0, contact.stiffness_n_m * depth_m - contact.damping_n_s_m * touch.normal.dot(velocity_m_s));
    if (depth_m <= 0.0) continue;
    const Vec3 force_n = normal_n * touch.normal + friction_n(touch, point, velocity_m_s, normal_n);
    sum.force_n += force_n;
    sum.torque_nm += offset.cross(body.R_local_body.conjugate() * force_n);
  }
  return sum;
}

/// Where friction slips, the point that it holds on to moves along, so that the spring keeps the force of sliding.
void Multirotor::slide_anchors() {
  const ContactOptions& contact = airframe_.contact;
  for (std::size_t i = 0; i < now_.touches.size(); ++i) {
    Touch& touch = now_.touches[i];
    if (!touch.active) continue;
    const Vec3 point = point_of(now_.body, airframe_.contact_points_m[i]);
    const double depth_m = touch.normal.dot(touch.plane_point - point);
    const Vec3 stretch = across(point - touch.anchor, touch.normal);
    const double most_m = contact.friction * std::max(0.0, depth_m);  // both springs are equally stiff
    if (stretch.norm() > most_m) touch.anchor = point - stretch * (most_m / stretch.norm());
  }
}

/// Springs alone would let a fast vehicle through a wall.
void Multirotor::keep_hull_out(const Vec3& from) {
  if (!obstacles_) return;
  const auto contact = vehicle::first_contact(obstacles_, from, now_.body.position_m, airframe_.hull_radius_m);
  if (!contact) return;
  record_impact(contact->point, contact->normal, now_.body.velocity_m_s);
  now_.body.position_m = contact->center;
  now_.body.velocity_m_s = vehicle::bounce_velocity(now_.body.velocity_m_s, contact->normal, {});
}

}  // namespace tileflight::vehicle
