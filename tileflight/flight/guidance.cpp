#include "tileflight/flight/guidance.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace tileflight::flight {
namespace {

using geometry::Vec2;
using geometry::Vec3;

/// Slower than this the craft has stopped; it then holds the place.
constexpr double kStopped_m_s = 0.25;
/// Slower than this a direction of flight means nothing.
constexpr double kLeastHeadingSpeed_m_s = 0.3;
/// Of the greatest turning rate, what a wanted turn uses; the rest corrects.
constexpr double kTurningShare = 0.7;
constexpr double kLandedSpeed_m_s = 0.05;  // AirSim's
constexpr double kLandedTime_s = 0.2;      // AirSim's ten times running
constexpr double kTakeOffMargin_m = 0.1;

constexpr std::array<bool, 3> kHoldAll{true, true, true};
constexpr std::array<bool, 3> kHoldLevel{true, true, false};

/// A yaw that moves to where it should be no faster than the craft turns.
class YawReference {
 public:
  YawReference(YawMode mode, Drivetrain drivetrain, const Moment& start, double max_rate_rad_s)
      : mode_(mode),
        drivetrain_(drivetrain),
        yaw_rad_(start.yaw_rad),
        max_rate_rad_s_(kTurningShare * max_rate_rad_s) {}

  void steer(Setpoint& setpoint, double step_s) {
    const double change = mode_.kind == YawMode::Kind::kRate ? mode_.value * step_s : towards_target(setpoint, step_s);
    yaw_rad_ = wrapped_rad(yaw_rad_ + change);
    setpoint.yaw_rad = yaw_rad_;
    setpoint.yaw_rate_rad_s = change / step_s;
  }

 private:
  double towards_target(const Setpoint& setpoint, double step_s) const {
    const double most = max_rate_rad_s_ * step_s;
    return std::clamp(wrapped_rad(target(setpoint) - yaw_rad_), -most, most);
  }
  double target(const Setpoint& setpoint) const {
    const Vec2 level = setpoint.velocity_m_s.head<2>();
    if (drivetrain_ == Drivetrain::kForwardOnly)
      return level.norm() < kLeastHeadingSpeed_m_s ? yaw_rad_ : std::atan2(level.y(), level.x()) + mode_.value;
    return mode_.kind == YawMode::Kind::kAngle ? mode_.value : yaw_rad_;
  }

  YawMode mode_;
  Drivetrain drivetrain_;
  double yaw_rad_;
  double max_rate_rad_s_;
};

/// Brakes, then holds the place where it stopped.
class Stopping {
 public:
  explicit Stopping(const std::optional<Vec3>& place) : place_(place) {}

  Setpoint setpoint(const Moment& now) {
    Setpoint setpoint;
    if (!place_ && now.state.velocity_m_s.norm() < kStopped_m_s) place_ = now.state.position_m;
    if (place_) {
      setpoint.position_m = *place_;
      setpoint.holds_position = kHoldAll;
    }
    return setpoint;
  }
  const std::optional<Vec3>& place() const { return place_; }

 private:
  std::optional<Vec3> place_;
};

void hold_height(const std::optional<double>& height_m, Setpoint& setpoint) {
  if (!height_m) return;
  setpoint.position_m.z() = *height_m;
  setpoint.holds_position[2] = true;
  setpoint.velocity_m_s.z() = 0.0;
}

/// Makes the guide of each command.
struct GuideMaker {
  const Moment& start;
  const ControllerOptions& limits;

  YawReference yaw(const YawMode& mode = {}, Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom) const {
    return {mode, drivetrain, start, limits.max_yaw_rate_rad_s};
  }

  Guide operator()(const TakeOff& c) const {
    const Vec3 goal = start.state.position_m + Vec3(0, 0, c.height_m);
    return [c, goal, yaw = yaw(), limits = limits](const Moment& now) mutable {
      const double left_m = goal.z() - now.state.position_m.z();
      Guided guided{{goal, kHoldLevel}, left_m < kTakeOffMargin_m, goal};
      guided.setpoint.velocity_m_s.z() =
          std::min(c.speed_m_s, approach_speed_m_s(std::max(0.0, left_m), limits.position_gain_up, 1.0));
      yaw.steer(guided.setpoint, now.step_s);
      return guided;
    };
  }

  Guide operator()(const Land& c) const {
    const Vec3 place = start.state.position_m;
    return [c, place, yaw = yaw(), still_s = 0.0](const Moment& now) mutable {
      const bool still = now.touching && std::abs(now.state.velocity_m_s.z()) <= kLandedSpeed_m_s;
      still_s = still ? still_s + now.step_s : 0.0;
      Guided guided{{place, kHoldLevel, Vec3(0, 0, -c.speed_m_s)}, still_s >= kLandedTime_s, now.state.position_m};
      yaw.steer(guided.setpoint, now.step_s);
      return guided;
    };
  }

  Guide operator()(const Hover& c) const {
    return [c, yaw = yaw(), stopping = Stopping({})](const Moment& now) mutable {
      Guided guided{stopping.setpoint(now), stopping.place() && now.time_s >= c.duration_s, stopping.place()};
      yaw.steer(guided.setpoint, now.step_s);
      return guided;
    };
  }

  Guide operator()(const FollowPath& c) const {
    std::vector<Vec3> points{start.state.position_m};
    points.insert(points.end(), c.points.begin(), c.points.end());
    const double automatic_m = std::max(0.75, c.speed_m_s * 0.02 * (c.adaptive_lookahead ? 30.0 : 40.0));
    return [c, path = PathProgress(points), end = points.back(), lookahead_m = c.lookahead_m.value_or(automatic_m),
            yaw = yaw(c.yaw, c.drivetrain), limits = limits](const Moment& now) mutable {
      const Vec3& position = now.state.position_m;
      path.follow(position, lookahead_m);
      const double ahead_m = path.progress_m() + lookahead_m;
      const Vec3 to_goal = path.at(ahead_m) - position;
      const double left_m = std::max(path.length_m() - path.progress_m(), (end - position).norm());
      const double speed_m_s = std::min(
          c.speed_m_s, approach_speed_m_s(left_m, limits.position_gain_level, 0.5 * limits.max_acceleration_m_s2));
      Guided guided;
      guided.setpoint.velocity_m_s = to_goal.normalized() * speed_m_s;
      guided.finished = ahead_m >= path.length_m() && (end - position).norm() <= c.arrival_m;
      guided.rest = end;
      yaw.steer(guided.setpoint, now.step_s);
      return guided;
    };
  }

  Guide operator()(const FlyVelocity& c) const {
    return [c, yaw = yaw(c.yaw, c.drivetrain)](const Moment& now) mutable {
      Guided guided{{}, now.time_s >= c.duration_s, {}};
      Setpoint& setpoint = guided.setpoint;
      const bool turned = c.frame == VelocityFrame::kHeading;
      setpoint.velocity_m_s =
          turned ? Vec3(level_orientation(yaw_rad(now.state.R_local_body)) * c.velocity_m_s) : c.velocity_m_s;
      hold_height(c.height_m, setpoint);
      yaw.steer(setpoint, now.step_s);
      return guided;
    };
  }

  Guide operator()(const Turn& c) const {
    return [c, yaw = yaw({YawMode::Kind::kAngle, c.yaw_rad}), stopping = Stopping({})](const Moment& now) mutable {
      const double off_rad = std::abs(wrapped_rad(yaw_rad(now.state.R_local_body) - c.yaw_rad));
      Guided guided{stopping.setpoint(now), stopping.place() && off_rad <= c.margin_rad, stopping.place()};
      yaw.steer(guided.setpoint, now.step_s);
      if (guided.finished) guided.setpoint.yaw_rad = c.yaw_rad;  // within the margin, and on to it
      return guided;
    };
  }

  Guide operator()(const TurnAtRate& c) const {
    return
        [c, yaw = yaw({YawMode::Kind::kRate, c.yaw_rate_rad_s}), stopping = Stopping({})](const Moment& now) mutable {
          Guided guided{stopping.setpoint(now), now.time_s >= c.duration_s, stopping.place()};
          yaw.steer(guided.setpoint, now.step_s);
          return guided;
        };
  }

  Guide operator()(const FlyAttitude& c) const {
    return [c, yaw = yaw(c.yaw), most_rad = limits.max_tilt_rad](const Moment& now) mutable {
      Guided guided{{}, now.time_s >= c.duration_s, {}};
      Setpoint& setpoint = guided.setpoint;
      yaw.steer(setpoint, now.step_s);
      const Eigen::Quaterniond lying = level_orientation(setpoint.yaw_rad) *
                                       Eigen::AngleAxisd(-std::clamp(c.pitch_rad, -most_rad, most_rad), Vec3::UnitY()) *
                                       Eigen::AngleAxisd(std::clamp(c.roll_rad, -most_rad, most_rad), Vec3::UnitX());
      setpoint.lean = LeanSetpoint{lying, {}, c.throttle};
      hold_height(c.height_m, setpoint);
      return guided;
    };
  }

  Guide operator()(const FlyRates& c) const {
    return [c](const Moment& now) {
      Guided guided{{}, now.time_s >= c.duration_s, {}};
      guided.setpoint.yaw_rad = yaw_rad(now.state.R_local_body);  // to go on with afterwards
      guided.setpoint.lean = LeanSetpoint{Eigen::Quaterniond::Identity(), c.rates_rad_s, c.throttle};
      hold_height(c.height_m, guided.setpoint);
      return guided;
    };
  }

  Guide operator()(const Track& c) const {
    return [c](const Moment& now) {
      return Guided{c.reference(std::min(now.time_s, c.duration_s)), now.time_s >= c.duration_s,
                    c.reference(c.duration_s).position_m};
    };
  }
};

}  // namespace

Guide guide_of(const Command& command, const Moment& start, const ControllerOptions& limits) {
  return std::visit(GuideMaker{start, limits}, command);
}

Guide guide_to_rest(const std::optional<Vec3>& place, const Moment& start) {
  return [stopping = Stopping(place), yaw = start.yaw_rad](const Moment& now) mutable {
    Guided guided{stopping.setpoint(now), false, {}};
    guided.setpoint.yaw_rad = yaw;
    return guided;
  };
}

double timeout_s(const Command& command) {
  return std::visit(
      [](const auto& c) {
        if constexpr (requires { c.timeout_s; }) return c.timeout_s;
        return kNoTimeout_s;
      },
      command);
}

PathProgress::PathProgress(std::vector<Vec3> points) : points_(std::move(points)), starts_m_{0.0} {
  for (std::size_t i = 1; i < points_.size(); ++i)
    starts_m_.push_back(starts_m_.back() + (points_[i] - points_[i - 1]).norm());
}

Vec3 PathProgress::at(double along_m) const {
  const auto after = std::upper_bound(starts_m_.begin(), starts_m_.end(), along_m);
  if (after == starts_m_.end()) return points_.back();
  if (after == starts_m_.begin()) return points_.front();
  const auto i = static_cast<std::size_t>(after - starts_m_.begin());
  const double share = (along_m - starts_m_[i - 1]) / (starts_m_[i] - starts_m_[i - 1]);
  return points_[i - 1] + share * (points_[i] - points_[i - 1]);
}

void PathProgress::follow(const Vec3& position, double reach_m) {
  const double from_m = progress_m_, to_m = std::min(from_m + reach_m, length_m());
  double least = (at(from_m) - position).norm();
  for (std::size_t i = 1; i < points_.size(); ++i) {
    const double begin_m = std::max(from_m, starts_m_[i - 1]), end_m = std::min(to_m, starts_m_[i]);
    if (begin_m >= end_m) continue;
    const Vec3 direction = (points_[i] - points_[i - 1]).normalized();
    const double nearest_m = std::clamp(starts_m_[i - 1] + direction.dot(position - points_[i - 1]), begin_m, end_m);
    const double distance = (at(nearest_m) - position).norm();
    if (distance >= least) continue;
    least = distance;
    progress_m_ = nearest_m;
  }
}

}  // namespace tileflight::flight
