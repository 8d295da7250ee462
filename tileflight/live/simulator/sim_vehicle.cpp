#include "tileflight/live/simulator/sim_vehicle.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/simulator/frames.h"
#include "tileflight/live/simulator/settings.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::simulator {
namespace {

using imaging::Camera;

constexpr std::array<const char*, 5> kDistortionNames{"K1", "K2", "K3", "P1", "P2"};
constexpr double kMaxDistortion = 100.0;
constexpr double kNearPlane_cm = 10.0;

/// The pinhole with Brown's distortion: OpenCV's order is k1 k2 p1 p2 k3.
Camera with_distortion(const Camera& lens, const std::array<double, 5>& k) {
  const auto* pinhole = std::get_if<imaging::PinholeRadtan>(&lens.model());
  const bool any = std::ranges::any_of(k, [](double value) { return value != 0.0; });
  if (pinhole == nullptr || !any) return lens;
  imaging::PinholeRational model{pinhole->fx, pinhole->fy, pinhole->cx, pinhole->cy, {}};
  model.d[0] = k[0];
  model.d[1] = k[1];
  model.d[2] = k[3];
  model.d[3] = k[4];
  model.d[4] = k[2];
  return {model, lens.width(), lens.height()};
}

}  // namespace

void SimCamera::set_fov(double fov_deg) {
  if (!(fov_deg >= 0.1 && fov_deg <= 179.9))
    throw InputError("camera '" + name() + "'", "the field of view must be from 0.1 to 179.9 degrees");
  for (CaptureSettings& capture : settings_.captures) {
    capture.fov_deg = fov_deg;
    capture.lens.reset();
  }
  pixels_per_rad_ = 0.0;
}

void SimCamera::set_distortion(const std::string& key, double value) {
  const auto at = std::ranges::find(kDistortionNames, key);
  if (at == kDistortionNames.end())
    throw InputError("camera '" + name() + "'",
                     "'" + key.substr(0, 20) + "' is not a distortion parameter; use K1, K2, K3, P1 or P2");
  if (!(std::abs(value) <= kMaxDistortion))
    throw InputError("camera '" + name() + "'", key + " must be from -100 to 100");
  distortion_[static_cast<std::size_t>(at - kDistortionNames.begin())] = value;
  pixels_per_rad_ = 0.0;
}

void SimCamera::set_lens(const LensDescription& lens) {
  std::array<CaptureSettings, kImageTypeCount> captures = settings_.captures;
  for (CaptureSettings& capture : captures) {
    if (lens.width != 0) capture.width = lens.width;
    if (lens.height != 0) capture.height = lens.height;
    capture.lens = lens;
    make_lens(capture, "camera '" + name() + "'");
  }
  settings_.captures = captures;
  pixels_per_rad_ = 0.0;
}

Camera SimCamera::lens(int image_type) const {
  return with_distortion(make_lens(capture(image_type), "camera '" + name() + "'"), distortion_);
}

double SimCamera::focal_px() const {
  constexpr double kSmall = 1e-4;
  const Camera camera = lens(0);
  const auto a = camera.project({-kSmall, 0.0, 1.0}), b = camera.project({kSmall, 0.0, 1.0});
  if (!a || !b) throw InputError("camera '" + name() + "'", "its lens does not see straight ahead: no focal length");
  return (b->x() - a->x()) / (2.0 * kSmall);
}

double SimCamera::vertical_fov_deg() const {
  const Camera camera = lens(0);
  const double column = 0.5 * (camera.width() - 1);
  const auto angle_at = [&](double row, double beyond) {
    const auto ray = camera.unproject({column, row});
    return ray ? std::atan2(ray->y(), ray->z()) : beyond;
  };
  const double widest = camera.max_theta_rad();
  return degrees(angle_at(camera.height() - 0.5, widest) - angle_at(-0.5, -widest));
}

/// AirSim's projection matrix: Unreal's perspective with reversed depth and no far plane, after a change of axes that
/// negates the forward axis, so that clip coordinates have w = -x (for x forward, y right, z down, 1). Both axes have
/// the scale of the longer side.
CameraInfo SimCamera::info(const geometry::SE3& T_ned_camera) const {
  CameraInfo info;
  info.pose = to_airsim(T_ned_camera);
  info.fov = static_cast<float>(capture(0).lens ? lens(0).horizontal_fov_deg() : fov_deg());
  const double scale = 1.0 / std::tan(0.5 * radians(fov_deg()));
  const double longer = std::max(width(0), height(0));
  auto& m = info.proj_mat.matrix;
  m[0][1] = static_cast<float>(scale * longer / width(0));
  m[1][2] = static_cast<float>(-scale * longer / height(0));
  m[2][3] = static_cast<float>(kNearPlane_cm);
  m[3][0] = -1.0F;
  return info;
}

double SimCamera::pixels_per_rad() const {
  if (pixels_per_rad_ > 0.0) return pixels_per_rad_;
  for (int type = 0; type < kImageTypeCount; ++type)
    pixels_per_rad_ = std::max(pixels_per_rad_, tileset::view_cone_of(lens(type)).pixels_per_rad);
  return pixels_per_rad_;
}

namespace {

using geometry::SE3;
using geometry::Vec3;

vehicle::VehicleOptions make_vehicle_options(const VehicleSettings& settings, const Vec3& wind_local_m_s) {
  vehicle::VehicleOptions options;
  options.collision = settings.enable_collisions ? vehicle::CollisionPolicy::kBounce : vehicle::CollisionPolicy::kOff;
  options.wind.mean_m_s = wind_local_m_s;
  return options;
}

}  // namespace

SimVehicle::SimVehicle(VehicleSettings settings, const SE3& T_local_ned, vehicle::ObstacleQuery obstacles,
                       const Vec3& wind_local_m_s)
    : armed(settings.armed),
      settings_(std::move(settings)),
      T_local_ned_(T_local_ned),
      obstacles_(std::move(obstacles)),
      options_(make_vehicle_options(settings_, wind_local_m_s)) {
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
  set_home({settings_.R_ned_body, settings_.start_ned});
}

void SimVehicle::set_home(const SE3& T_ned_body) {
  T_ned_home_ = T_ned_body;
  teleport({T_ned_home_});
}

void SimVehicle::settle_at_home() {
  if (!settings_.autopilot) return;
  multirotor_ = std::make_unique<vehicle::Multirotor>(vehicle::make_airframe(settings_.autopilot->airframe), obstacles_,
                                                      options_.wind, position_local(), yaw_local_rad());
  state_ = simulated_state(multirotor_->state());
  T_ned_home_ = state_.T_ned_body;
}

void SimVehicle::teleport(const VehicleState& state) {
  cancel();
  flight_.reset();
  state_ = state;
  if (multirotor_) place_multirotor();
}

/// The autopilot's vehicle goes on from the state that it was placed in.
void SimVehicle::place_multirotor() {
  const SE3 T_local_body = T_local_ned_ * state_.T_ned_body * T_flu_frd().inverse();
  multirotor_->place({T_local_body.translation, T_local_ned_.rotation * state_.velocity_m_s, T_local_body.rotation,
                      frd_from_flu(state_.angular_velocity_rad_s)});
}

void SimVehicle::return_to_start() {
  teleport({T_ned_home_});
  if (multirotor_) {
    multirotor_->reset();
    state_ = simulated_state(multirotor_->state());
  }
  collision_ = {};
}

void SimVehicle::reset() {
  return_to_start();
  api_control = false;
  armed = settings_.armed;
  cameras_.clear();
  for (const CameraSettings& camera : settings_.cameras) cameras_.emplace_back(camera);
}

void SimVehicle::sweep_to(const SE3& T_ned_body, double time_s) {
  const Vec3 from = position_local();
  const Vec3 to = T_local_ned_ * T_ned_body.translation;
  SE3 reached = T_ned_body;
  const auto contact = vehicle::first_contact(obstacles_, from, to, options_.radius_m);
  if (contact) {
    const SE3 T_ned_local = T_local_ned_.inverse();
    reached.translation = T_ned_local * contact->center;
    collision_ = {true,
                  time_s,
                  T_ned_local * contact->point,
                  T_ned_local.rotation * contact->normal,
                  reached.translation,
                  (to - contact->center).norm(),
                  contact->object};
  }
  teleport({reached});
}

double SimVehicle::yaw_local_rad() const {
  return vehicle::yaw_rad((T_local_ned_ * state_.T_ned_body * T_flu_frd().inverse()).rotation);
}

std::shared_ptr<const vehicle::Task> SimVehicle::command(const vehicle::Command& command) {
  vehicle::check(command);
  if (settings_.autopilot)
    throw InputError("vehicle '" + settings_.name + "'", "is flown by its autopilot; send commands to that");
  if (!flight_) {
    const bool on_ground = vehicle::touches(obstacles_, position_local(), options_.radius_m + 0.02);
    flight_ = std::make_unique<vehicle::Vehicle>(options_, obstacles_, position_local(), yaw_local_rad(), on_ground);
    contact_seen_s_ = 0.0;
  }
  task_ = flight_->command(command);
  return task_;
}

void SimVehicle::cancel() {
  if (flight_) flight_->cancel();
}

bool SimVehicle::landed() const {
  if (multirotor_) return multirotor_->touching();
  return flight_ ? flight_->landed() : true;
}

std::vector<vehicle::Rotor> SimVehicle::rotors() const {
  if (multirotor_) return multirotor_->airframe().rotors;
  return options_.quadrotor.rotors;
}

std::vector<double> SimVehicle::rotor_speeds_rad_s() const {
  if (multirotor_) return multirotor_->rotor_speeds_rad_s();
  std::vector<double> speeds(vehicle::kRotors, 0.0);
  if (flight_) std::ranges::copy(flight_->rotor_speeds_rad_s(), speeds.begin());
  return speeds;
}

Vec3 SimVehicle::wind_ned_m_s() const {
  return ned_from_enu(multirotor_ ? multirotor_->wind_m_s() : options_.wind.mean_m_s);
}

void SimVehicle::set_wind(const Vec3& wind_local_m_s) {
  options_.wind.mean_m_s = wind_local_m_s;
  if (flight_) flight_->set_wind(wind_local_m_s);
  if (multirotor_) multirotor_->set_wind(wind_local_m_s);
}

VehicleState SimVehicle::simulated_state(const vehicle::RigidBodyState& body) const {
  const SE3 T_ned_local = T_local_ned_.inverse();
  VehicleState state;
  state.T_ned_body = T_ned_local * SE3(body.R_local_body, body.position_m) * T_flu_frd();
  state.velocity_m_s = T_ned_local.rotation * body.velocity_m_s;
  state.angular_velocity_rad_s = frd_from_flu(body.angular_velocity_rad_s);
  return state;
}

void SimVehicle::step(double time_s) {
  if (!flight_) return;
  const VehicleState before = state_;
  flight_->step();
  state_ = simulated_state(flight_->state());
  state_.acceleration_m_s2 = (state_.velocity_m_s - before.velocity_m_s) / options_.step_s;
  state_.angular_acceleration_rad_s2 =
      (state_.angular_velocity_rad_s - before.angular_velocity_rad_s) / options_.step_s;
  const auto& contact = flight_->last_contact();
  if (contact && contact->time_s > contact_seen_s_) record_contact(*contact, time_s);
}

void SimVehicle::step_motors(std::span<const double> outputs, double step_s, double time_s) {
  std::vector<double> shares;
  for (const double output : outputs) shares.push_back(vehicle::thrust_share(output, settings_.autopilot->thrust_expo));
  const Vec3 turned_before = state_.angular_velocity_rad_s;
  multirotor_->step(shares, step_s);
  state_ = simulated_state(multirotor_->state());
  const Vec3 gravity(0.0, 0.0, vehicle::kStandardGravity_m_s2);
  state_.acceleration_m_s2 =
      state_.T_ned_body.rotation * frd_from_flu(multirotor_->inertial().accelerometer_m_s2) + gravity;
  state_.angular_acceleration_rad_s2 = (state_.angular_velocity_rad_s - turned_before) / step_s;
  if (multirotor_->impact()) record_impact(time_s);
}

/// Setting down gently is no collision, as for vehicle::Vehicle.
void SimVehicle::record_impact(double time_s) {
  constexpr double kLanding_m_s = 1.5, kLandingNormalZ = 0.7;
  const vehicle::Impact& last = *multirotor_->impact();
  if (last.speed_m_s <= kLanding_m_s && last.normal.z() >= kLandingNormalZ) return;
  const SE3 T_ned_local = T_local_ned_.inverse();
  collision_ = {
      true, time_s, T_ned_local * last.point, T_ned_local.rotation * last.normal, state_.T_ned_body.translation, 0.0};
}

void SimVehicle::record_contact(const vehicle::Collision& last, double time_s) {
  contact_seen_s_ = last.time_s;
  const SE3 T_ned_local = T_local_ned_.inverse();
  collision_ = {
      true, time_s,     T_ned_local * last.point, T_ned_local.rotation * last.normal, state_.T_ned_body.translation,
      0.0,  last.object};
}

}  // namespace tileflight::simulator
