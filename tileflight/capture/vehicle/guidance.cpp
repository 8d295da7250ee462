#include "tileflight/capture/vehicle/guidance.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <type_traits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::vehicle {

namespace {

bool is_positive(double value) { return std::isfinite(value) && value > 0.0; }
bool is_valid_duration(double value_s) { return std::isfinite(value_s) && value_s >= 0.0; }

/// Checks a timeout: positive seconds or infinite.
void require_timeout(double timeout_s, const std::string& command) {
  base::require(timeout_s > 0.0, command, "the timeout must be more than 0 seconds");
}

void require_yaw(const YawMode& yaw, Drivetrain drivetrain, const std::string& command) {
  base::require(std::isfinite(yaw.value), command, "the yaw must be finite");
  base::require(drivetrain == Drivetrain::kMaxDegreeOfFreedom || yaw.kind != YawMode::Kind::kRate, command,
                "a yaw rate is not possible when flying forward only; give an angle from the direction of flight");
}

template <class Leaning>
void require_height_or_throttle(const Leaning& c, const char* command) {
  base::require(c.height_m.has_value() != c.throttle.has_value(), command,
                "give either a height or a throttle, not both");
  base::require(std::isfinite(c.height_m.value_or(0.0)), command, "the height must be finite");
  base::require(c.throttle.value_or(0.0) >= 0.0 && c.throttle.value_or(0.0) <= 1.0, command,
                "the throttle must be from 0 to 1");
  base::require(is_valid_duration(c.duration_s), command, "the duration must not be negative");
}

struct Checker {
  void operator()(const TakeOff& c) const {
    base::require(is_positive(c.height_m), "take-off", "the height must be more than 0");
    base::require(is_positive(c.speed_m_s), "take-off", "the speed must be more than 0");
    require_timeout(c.timeout_s, "take-off");
  }
  void operator()(const Land& c) const {
    base::require(is_positive(c.speed_m_s), "land", "the speed must be more than 0");
    require_timeout(c.timeout_s, "land");
  }
  void operator()(const Hover& c) const {
    base::require(is_valid_duration(c.duration_s), "hover", "the duration must not be negative");
  }
  void operator()(const FollowPath& c) const {
    for (const geometry::Vec3& point : c.points) base::require(point.allFinite(), "path", "a point is not finite");
    base::require(is_positive(c.speed_m_s), "path", "the speed must be more than 0");
    base::require(!c.lookahead_m || is_positive(*c.lookahead_m), "path", "the lookahead must be more than 0");
    base::require(is_positive(c.arrival_m), "path", "the arrival distance must be more than 0");
    require_timeout(c.timeout_s, "path");
    require_yaw(c.yaw, c.drivetrain, "path");
  }
  void operator()(const FlyVelocity& c) const {
    base::require(c.velocity_m_s.allFinite() && std::isfinite(c.height_m.value_or(0.0)), "velocity", "is not finite");
    base::require(is_valid_duration(c.duration_s), "velocity", "the duration must not be negative");
    require_yaw(c.yaw, c.drivetrain, "velocity");
  }
  void operator()(const TurnToYaw& c) const {
    base::require(std::isfinite(c.yaw_rad), "turn", "the yaw must be finite");
    base::require(is_positive(c.margin_rad), "turn", "the margin must be more than 0");
    require_timeout(c.timeout_s, "turn");
  }
  void operator()(const TurnAtRate& c) const {
    base::require(std::isfinite(c.yaw_rate_rad_s), "turn", "the rate must be finite");
    base::require(is_valid_duration(c.duration_s), "turn", "the duration must not be negative");
  }
  void operator()(const FlyAttitude& c) const {
    base::require(std::isfinite(c.roll_rad) && std::isfinite(c.pitch_rad), "attitude", "an angle is not finite");
    require_yaw(c.yaw, Drivetrain::kMaxDegreeOfFreedom, "attitude");
    require_height_or_throttle(c, "attitude");
  }
  void operator()(const FlyRates& c) const {
    base::require(c.rates_rad_s.allFinite(), "rates", "a rate is not finite");
    require_height_or_throttle(c, "rates");
  }
  void operator()(const TrackReference& c) const {
    base::require(static_cast<bool>(c.reference), "track", "has no reference");
    base::require(is_valid_duration(c.duration_s), "track", "the duration must not be negative");
  }
};

}  // namespace

void check(const Command& command) { std::visit(Checker{}, command); }

namespace {

using geometry::Vec2;
using geometry::Vec3;

/// Below this speed the vehicle counts as stopped and holds its position.
constexpr double kStopped_m_s = 0.25;
/// Below this speed the direction of flight is undefined.
constexpr double kMinHeadingSpeed_m_s = 0.3;
/// Share of the maximum yaw rate used by reference motions; the rest is left for corrections.
constexpr double kTurningShare = 0.7;
constexpr double kLandedSpeed_m_s = 0.05;  // AirSim's
constexpr double kLandedTime_s = 0.2;      // AirSim's ten consecutive checks
constexpr double kTakeOffMargin_m = 0.1;

constexpr std::array<bool, 3> kHoldAll{true, true, true};
constexpr std::array<bool, 3> kHoldLevel{true, true, false};

/// A yaw reference that approaches its target no faster than the vehicle can turn.
class YawReference {
 public:
  YawReference(YawMode mode, Drivetrain drivetrain, const GuidanceInput& start, double max_rate_rad_s)
      : mode_(mode),
        drivetrain_(drivetrain),
        yaw_rad_(start.yaw_rad),
        max_rate_rad_s_(kTurningShare * max_rate_rad_s) {}

  void update(Setpoint& setpoint, double step_s) {
    const double change = mode_.kind == YawMode::Kind::kRate ? mode_.value * step_s : step_to_target(setpoint, step_s);
    yaw_rad_ = wrap_angle_rad(yaw_rad_ + change);
    setpoint.yaw_rad = yaw_rad_;
    setpoint.yaw_rate_rad_s = change / step_s;
  }
  /// Whether it is at its target.
  bool is_reached(const Setpoint& setpoint) const {
    constexpr double kSame_rad = 1e-3;
    return std::abs(wrap_angle_rad(target(setpoint) - yaw_rad_)) < kSame_rad;
  }

 private:
  double step_to_target(const Setpoint& setpoint, double step_s) const {
    const double most = max_rate_rad_s_ * step_s;
    return std::clamp(wrap_angle_rad(target(setpoint) - yaw_rad_), -most, most);
  }
  double target(const Setpoint& setpoint) const {
    const Vec2 level = setpoint.velocity_m_s.head<2>();
    if (drivetrain_ == Drivetrain::kForwardOnly)
      return level.norm() < kMinHeadingSpeed_m_s ? yaw_rad_ : std::atan2(level.y(), level.x()) + mode_.value;
    return mode_.kind == YawMode::Kind::kAngle ? mode_.value : yaw_rad_;
  }

  YawMode mode_;
  Drivetrain drivetrain_;
  double yaw_rad_;
  double max_rate_rad_s_;
};

/// Brakes, then holds the position where it stopped.
class StopAndHold {
 public:
  explicit StopAndHold(const std::optional<Vec3>& place) : place_(place) {}

  Setpoint setpoint(const GuidanceInput& now) {
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

/// Creates the guidance law of each command.
struct GuidanceFactory {
  const GuidanceInput& start;
  const ControllerOptions& limits;

  YawReference yaw(const YawMode& mode = {}, Drivetrain drivetrain = Drivetrain::kMaxDegreeOfFreedom) const {
    return {mode, drivetrain, start, limits.max_yaw_rate_rad_s};
  }

  GuidanceLaw operator()(const TakeOff& c) const {
    const Vec3 goal = start.state.position_m + Vec3(0, 0, c.height_m);
    return [c, goal, yaw = yaw(), limits = limits](const GuidanceInput& now) mutable {
      const double left_m = goal.z() - now.state.position_m.z();
      GuidanceOutput guided{{goal, kHoldLevel}, left_m < kTakeOffMargin_m, goal};
      guided.setpoint.velocity_m_s.z() =
          std::min(c.speed_m_s, approach_speed_m_s(std::max(0.0, left_m), limits.position_gain_vertical, 1.0));
      yaw.update(guided.setpoint, now.step_s);
      return guided;
    };
  }

  GuidanceLaw operator()(const Land& c) const {
    const Vec3 place = start.state.position_m;
    return [c, place, yaw = yaw(), still_s = 0.0](const GuidanceInput& now) mutable {
      const bool still = now.touching && std::abs(now.state.velocity_m_s.z()) <= kLandedSpeed_m_s;
      still_s = still ? still_s + now.step_s : 0.0;
      GuidanceOutput guided{
          {place, kHoldLevel, Vec3(0, 0, -c.speed_m_s)}, still_s >= kLandedTime_s, now.state.position_m};
      yaw.update(guided.setpoint, now.step_s);
      return guided;
    };
  }

  GuidanceLaw operator()(const Hover& c) const {
    return [c, yaw = yaw(), stopping = StopAndHold({})](const GuidanceInput& now) mutable {
      GuidanceOutput guided{stopping.setpoint(now), stopping.place() && now.time_s >= c.duration_s, stopping.place()};
      yaw.update(guided.setpoint, now.step_s);
      return guided;
    };
  }

  GuidanceLaw operator()(const FollowPath& c) const {
    std::vector<Vec3> points{start.state.position_m};
    points.insert(points.end(), c.points.begin(), c.points.end());
    const double automatic_m = std::max(0.75, c.speed_m_s * 0.02 * (c.adaptive_lookahead ? 30.0 : 40.0));
    return [c, path = PathProgress(points), end = points.back(), lookahead_m = c.lookahead_m.value_or(automatic_m),
            yaw = yaw(c.yaw, c.drivetrain), limits = limits](const GuidanceInput& now) mutable {
      const Vec3& position = now.state.position_m;
      path.advance_to_nearest(position, lookahead_m);
      const double ahead_m = path.progress_m() + lookahead_m;
      const Vec3 to_goal = path.at(ahead_m) - position;
      const double left_m = std::max(path.length_m() - path.progress_m(), (end - position).norm());
      const double speed_m_s = std::min(
          c.speed_m_s, approach_speed_m_s(left_m, limits.position_gain_horizontal, 0.5 * limits.max_acceleration_m_s2));
      GuidanceOutput guided;
      guided.setpoint.velocity_m_s = to_goal.normalized() * speed_m_s;
      guided.finished = ahead_m >= path.length_m() && (end - position).norm() <= c.arrival_m;
      guided.hold_position = end;
      yaw.update(guided.setpoint, now.step_s);
      if (c.turns_first && !yaw.is_reached(guided.setpoint)) guided.finished = false;
      return guided;
    };
  }

  GuidanceLaw operator()(const FlyVelocity& c) const {
    return [c, yaw = yaw(c.yaw, c.drivetrain)](const GuidanceInput& now) mutable {
      GuidanceOutput guided{{}, now.time_s >= c.duration_s, {}};
      Setpoint& setpoint = guided.setpoint;
      const bool turned = c.frame == VelocityFrame::kHeading;
      setpoint.velocity_m_s =
          turned ? Vec3(level_orientation(yaw_rad(now.state.R_local_body)) * c.velocity_m_s) : c.velocity_m_s;
      hold_height(c.height_m, setpoint);
      yaw.update(setpoint, now.step_s);
      return guided;
    };
  }

  GuidanceLaw operator()(const TurnToYaw& c) const {
    return [c, yaw = yaw({YawMode::Kind::kAngle, c.yaw_rad}),
            stopping = StopAndHold({})](const GuidanceInput& now) mutable {
      const double off_rad = std::abs(wrap_angle_rad(yaw_rad(now.state.R_local_body) - c.yaw_rad));
      GuidanceOutput guided{stopping.setpoint(now), stopping.place() && off_rad <= c.margin_rad, stopping.place()};
      yaw.update(guided.setpoint, now.step_s);
      if (guided.finished) guided.setpoint.yaw_rad = c.yaw_rad;  // within the margin: hold the target
      return guided;
    };
  }

  GuidanceLaw operator()(const TurnAtRate& c) const {
    return [c, yaw = yaw({YawMode::Kind::kRate, c.yaw_rate_rad_s}),
            stopping = StopAndHold({})](const GuidanceInput& now) mutable {
      GuidanceOutput guided{stopping.setpoint(now), now.time_s >= c.duration_s, stopping.place()};
      yaw.update(guided.setpoint, now.step_s);
      return guided;
    };
  }

  GuidanceLaw operator()(const FlyAttitude& c) const {
    return [c, yaw = yaw(c.yaw), most_rad = limits.max_tilt_rad](const GuidanceInput& now) mutable {
      GuidanceOutput guided{{}, now.time_s >= c.duration_s, {}};
      Setpoint& setpoint = guided.setpoint;
      yaw.update(setpoint, now.step_s);
      const Eigen::Quaterniond lying = level_orientation(setpoint.yaw_rad) *
                                       Eigen::AngleAxisd(-std::clamp(c.pitch_rad, -most_rad, most_rad), Vec3::UnitY()) *
                                       Eigen::AngleAxisd(std::clamp(c.roll_rad, -most_rad, most_rad), Vec3::UnitX());
      setpoint.attitude = AttitudeSetpoint{lying, {}, c.throttle};
      hold_height(c.height_m, setpoint);
      return guided;
    };
  }

  GuidanceLaw operator()(const FlyRates& c) const {
    return [c](const GuidanceInput& now) {
      GuidanceOutput guided{{}, now.time_s >= c.duration_s, {}};
      guided.setpoint.yaw_rad = yaw_rad(now.state.R_local_body);  // yaw to hold afterwards
      guided.setpoint.attitude = AttitudeSetpoint{Eigen::Quaterniond::Identity(), c.rates_rad_s, c.throttle};
      hold_height(c.height_m, guided.setpoint);
      return guided;
    };
  }

  GuidanceLaw operator()(const TrackReference& c) const {
    return [c](const GuidanceInput& now) {
      return GuidanceOutput{c.reference(std::min(now.time_s, c.duration_s)), now.time_s >= c.duration_s,
                            c.reference(c.duration_s).position_m};
    };
  }
};

}  // namespace

GuidanceLaw make_guidance(const Command& command, const GuidanceInput& start, const ControllerOptions& limits) {
  return std::visit(GuidanceFactory{start, limits}, command);
}

GuidanceLaw make_stop_guidance(const std::optional<Vec3>& place, const GuidanceInput& start) {
  return [stopping = StopAndHold(place), yaw = start.yaw_rad](const GuidanceInput& now) mutable {
    GuidanceOutput guided{stopping.setpoint(now), false, {}};
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

void PathProgress::advance_to_nearest(const Vec3& position, double reach_m) {
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

}  // namespace tileflight::vehicle
