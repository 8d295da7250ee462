#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "tileflight/capture/vehicle/airframe.h"
#include "tileflight/capture/vehicle/collision.h"
#include "tileflight/capture/vehicle/wind.h"

namespace tileflight::vehicle {

/// Readings of an ideal inertial unit at the centre of mass over the last step: means of the angular rate and of the
/// specific force (acceleration without gravity, ground contact included), body axes forward, left, up.
struct InertialReading {
  geometry::Vec3 gyro_rad_s = geometry::Vec3::Zero();
  geometry::Vec3 accelerometer_m_s2 = geometry::Vec3::Zero();
};

/// The hardest impact of a step on a surface.
struct Impact {
  geometry::Vec3 point;   ///< on the surface
  geometry::Vec3 normal;  ///< unit length, towards the vehicle
  double speed_m_s = 0.0;
};

/// A multirotor whose motors an autopilot drives, in wind and on the surfaces of a place. Rigid body with rotors as
/// vehicle::multirotor_wrench(); feet, propellers' tips and top are spring and damper against the surface that lies
/// between them and the centre of mass, with Coulomb friction whose sticking is a spring of its own (Cundall and
/// Strack, Geotechnique 29(1), 1979), so that a vehicle at rest on a slope stays there. It moves only in step(): the
/// same outputs give bit-identical states.
class Multirotor {
 public:
  /// Puts the vehicle down with its motors off: its feet stand on the ground below the position (local frame), tilted
  /// as the ground is, and it settles there. Where there is no ground within 10 m below, it starts at the position
  /// itself.
  Multirotor(Airframe airframe, vehicle::ObstacleQuery obstacles, const vehicle::WindOptions& wind,
             const geometry::Vec3& position_m, double yaw_rad);

  /// Returns to the start: state, wind and all.
  void reset();
  /// Advances by `step_s` (positive) in parts of at most a millisecond. `thrust_shares`: of each motor, 0 to 1; motors
  /// without one stand still.
  void step(std::span<const double> thrust_shares, double step_s);
  /// Goes on from this state; rotor speeds and wind stay.
  void place(const vehicle::RigidBodyState& body);
  /// Changes the mean wind, now and after reset().
  void set_wind(const geometry::Vec3& mean_m_s);

  const vehicle::RigidBodyState& state() const { return now_.body; }
  /// State in which it waits for its autopilot.
  const vehicle::RigidBodyState& start() const { return start_.body; }
  const InertialReading& inertial() const { return now_.inertial; }
  geometry::Vec3 wind_m_s() const { return now_.wind.velocity_m_s(); }
  /// Whether any point touches a surface.
  bool touching() const;
  const std::vector<double>& rotor_speeds_rad_s() const { return now_.rotor_speeds_rad_s; }
  const std::optional<Impact>& impact() const { return now_.impact; }
  const Airframe& airframe() const { return airframe_; }

 private:
  /// A contact point: the plane that it is pressed into, and the point at which friction holds it.
  struct Touch {
    bool active = false;
    geometry::Vec3 plane_point = geometry::Vec3::Zero(), normal = geometry::Vec3::UnitZ();
    geometry::Vec3 anchor = geometry::Vec3::Zero();
  };
  struct State {
    vehicle::RigidBodyState body;
    std::vector<double> rotor_speeds_rad_s;
    std::vector<Touch> touches;
    vehicle::Wind wind;
    InertialReading inertial;
    std::optional<Impact> impact;
  };

  /// Puts all feet just above the ground below; false if there is none.
  bool put_down(double yaw_rad);
  void settle();
  void step_part(std::span<const double> targets_rad_s, double step_s);
  void find_touches();
  void slide_anchors();
  void keep_hull_out(const geometry::Vec3& from);
  void record_impact(const geometry::Vec3& point, const geometry::Vec3& normal, const geometry::Vec3& velocity_m_s);
  geometry::Vec3 friction_n(const Touch& touch, const geometry::Vec3& point, const geometry::Vec3& velocity_m_s,
                            double normal_n) const;
  vehicle::Wrench contact_wrench(const vehicle::RigidBodyState& body) const;

  Airframe airframe_;
  vehicle::ObstacleQuery obstacles_;
  vehicle::WindOptions wind_options_;
  State now_, start_;
};

}  // namespace tileflight::vehicle
