#include "tileflight/capture/vehicle/vehicle_command.h"

#include <cmath>
#include <string>

#include "tileflight/core/base/input_error.h"

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

}  // namespace tileflight::vehicle
