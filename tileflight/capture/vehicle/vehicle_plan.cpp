#include "tileflight/capture/vehicle/vehicle_plan.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::vehicle {
namespace {

using base::StrictSection;
using geometry::kRadiansPerDegree;
using geometry::Vec3;

/// Commands in a file always have a timeout.
constexpr double kDefaultTimeout_s = 600.0;
constexpr std::size_t kMaxPoints = 10000;

Vec3 read_vector(StrictSection& section, const std::string& key, const Vec3& fallback) {
  const auto numbers = section.numbers(key, 3, 3);
  return numbers ? Vec3(numbers->at(0), numbers->at(1), numbers->at(2)) : fallback;
}

Vec3 read_required_vector(StrictSection& section, const std::string& key) {
  const auto numbers = section.numbers(key, 3, 3);
  if (!numbers) throw section.error(key, "is missing; give three numbers");
  return {numbers->at(0), numbers->at(1), numbers->at(2)};
}

WindOptions read_wind(StrictSection& section) {
  WindOptions wind;
  constexpr double kHurricane_m_s = 100.0;
  wind.mean_m_s = read_vector(section, "wind_m_s", wind.mean_m_s);
  if (!(wind.mean_m_s.norm() <= kHurricane_m_s)) throw section.error("wind_m_s", "must be at most 100 m/s");
  const std::string word = section.choice("turbulence", {"none", "light", "moderate", "severe"}).value_or("none");
  wind.turbulence = word == "light"      ? Turbulence::kLight
                    : word == "moderate" ? Turbulence::kModerate
                    : word == "severe"   ? Turbulence::kSevere
                                         : Turbulence::kNone;
  wind.height_above_ground_m = section.positive_number("height_above_ground_m").value_or(wind.height_above_ground_m);
  const int seed = section.integer("seed").value_or(1);
  if (seed < 0) throw section.error("seed", "must not be negative");
  wind.seed = static_cast<std::uint64_t>(seed);
  return wind;
}

CollisionPolicy read_collision(StrictSection& section) {
  const std::string word = section.choice("collision", {"off", "stop", "bounce"}).value_or("off");
  if (word == "off") return CollisionPolicy::kOff;
  return word == "stop" ? CollisionPolicy::kStop : CollisionPolicy::kBounce;
}

void read_quadrotor(StrictSection& section, VehicleOptions& options) {
  MultirotorOptions& quadrotor = options.quadrotor;
  quadrotor.body.mass_kg = section.positive_number("mass_kg").value_or(quadrotor.body.mass_kg);
  quadrotor.linear_drag_n_s_m = read_vector(section, "linear_drag", quadrotor.linear_drag_n_s_m);
  quadrotor.quadratic_drag_n_s2_m2 = read_vector(section, "quadratic_drag", quadrotor.quadratic_drag_n_s2_m2);
  options.controller.max_tilt_rad =
      section.positive_number("max_tilt_deg").value_or(options.controller.max_tilt_rad / kRadiansPerDegree) *
      kRadiansPerDegree;
}

/// Reads a duration with an upper limit: longer than any battery lasts, but finite in case of a typing error.
double read_seconds(StrictSection& step, const char* key, double fallback_s) {
  constexpr double kMost_s = 3600.0;
  const double value_s = step.number(key).value_or(fallback_s);
  if (!(value_s >= 0.0 && value_s <= kMost_s)) throw step.error(key, "must be from 0 to 3600 seconds");
  return value_s;
}

double read_timeout(StrictSection& step) {
  step.positive_number("timeout_s").value_or(kDefaultTimeout_s);
  return read_seconds(step, "timeout_s", kDefaultTimeout_s);
}

void read_yaw(StrictSection& step, YawMode& yaw, Drivetrain& drivetrain) {
  const std::string word = step.choice("drivetrain", {"free", "forward"}).value_or("free");
  drivetrain = word == "forward" ? Drivetrain::kForwardOnly : Drivetrain::kMaxDegreeOfFreedom;
  const auto heading_deg = step.number("heading_deg"), rate_deg_s = step.number("yaw_rate_deg_s");
  if (heading_deg && rate_deg_s) throw step.error("yaw_rate_deg_s", "and heading_deg are both given; keep one");
  if (drivetrain == Drivetrain::kForwardOnly && (heading_deg || rate_deg_s))
    throw step.error("drivetrain", "'forward' already sets the heading; leave out heading_deg and yaw_rate_deg_s");
  if (heading_deg) yaw = {YawMode::Kind::kAngle, heading_to_yaw_rad(*heading_deg)};
  if (rate_deg_s) yaw = {YawMode::Kind::kRate, -*rate_deg_s * kRadiansPerDegree};
}

std::vector<Vec3> read_points(StrictSection& step) {
  const auto numbers = step.numbers("points", 3, 3 * kMaxPoints);
  if (!numbers || numbers->size() % 3 != 0)
    throw step.error("points", "must be a list of numbers: east, north, up of each point in turn");
  std::vector<Vec3> points;
  for (std::size_t i = 0; i < numbers->size(); i += 3)
    points.emplace_back((*numbers)[i], (*numbers)[i + 1], (*numbers)[i + 2]);
  return points;
}

FollowPath read_path(StrictSection& step, bool one_point) {
  FollowPath path;
  path.points = one_point ? std::vector<Vec3>{read_required_vector(step, "position")} : read_points(step);
  path.speed_m_s = step.positive_number("speed_m_s").value_or(path.speed_m_s);
  read_yaw(step, path.yaw, path.drivetrain);
  path.lookahead_m = step.number("lookahead_m");
  path.timeout_s = read_timeout(step);
  return path;
}

FlyVelocity read_velocity(StrictSection& step) {
  FlyVelocity velocity;
  velocity.velocity_m_s = read_required_vector(step, "velocity_m_s");
  velocity.duration_s = read_seconds(step, "duration_s", velocity.duration_s);
  if (step.choice("frame", {"local", "heading"}).value_or("local") == "heading")
    velocity.frame = VelocityFrame::kHeading;
  velocity.height_m = step.number("height_m");
  read_yaw(step, velocity.yaw, velocity.drivetrain);
  return velocity;
}

TurnToYaw read_turn(StrictSection& step) {
  const auto heading_deg = step.number("heading_deg");
  if (!heading_deg) throw step.error("heading_deg", "is missing");
  TurnToYaw turn{heading_to_yaw_rad(*heading_deg)};
  turn.margin_rad =
      step.positive_number("margin_deg").value_or(turn.margin_rad / kRadiansPerDegree) * kRadiansPerDegree;
  turn.timeout_s = read_timeout(step);
  return turn;
}

TurnAtRate read_turn_rate(StrictSection& step) {
  const auto rate_deg_s = step.number("yaw_rate_deg_s");
  if (!rate_deg_s) throw step.error("yaw_rate_deg_s", "is missing");
  return {-*rate_deg_s * kRadiansPerDegree, read_seconds(step, "duration_s", 1.0)};
}

Command read_command(const std::string& word, StrictSection& step) {
  if (word == "takeoff") {
    const TakeOff defaults;
    return TakeOff{step.positive_number("height_m").value_or(defaults.height_m),
                   step.positive_number("speed_m_s").value_or(defaults.speed_m_s), read_timeout(step)};
  }
  if (word == "land") return Land{step.positive_number("speed_m_s").value_or(Land{}.speed_m_s), read_timeout(step)};
  if (word == "hover") return Hover{read_seconds(step, "duration_s", 0.0)};
  if (word == "velocity") return read_velocity(step);
  if (word == "turn") return read_turn(step);
  if (word == "turn_rate") return read_turn_rate(step);
  return read_path(step, word == "go_to");
}

}  // namespace

CameraMount read_mount(StrictSection& section) {
  CameraMount mount;
  mount.gimbal = section.choice("mount", {"gimbal", "fixed"}).value_or("gimbal") == "gimbal";
  mount.pitch_deg = section.number("pitch_deg").value_or(mount.pitch_deg);
  if (std::abs(mount.pitch_deg) > 90.0) throw section.error("pitch_deg", "must be from -90 to 90");
  mount.offset_m = read_vector(section, "offset_m", mount.offset_m);
  return mount;
}

VehiclePlan read_vehicle(StrictSection& section) {
  VehiclePlan plan;
  VehicleOptions& options = plan.options;
  options.wind = read_wind(section);
  options.collision = read_collision(section);
  options.bounce.restitution = section.number("restitution").value_or(options.bounce.restitution);
  options.bounce.friction = section.number("friction").value_or(options.bounce.friction);
  options.radius_m = section.positive_number("radius_m").value_or(options.radius_m);
  read_quadrotor(section, options);
  plan.mount = read_mount(section);
  plan.start_m = read_vector(section, "start", plan.start_m);
  plan.start_yaw_rad = heading_to_yaw_rad(section.number("start_heading_deg").value_or(0.0));
  plan.landed = section.boolean("landed").value_or(false);
  section.require_all_keys_used();
  return plan;
}

std::vector<MissionStep> read_mission(StrictSection& plan) {
  std::vector<MissionStep> mission;
  for (StrictSection& step : plan.sections("mission")) {
    const auto word = step.choice("do", {"takeoff", "land", "hover", "go_to", "path", "velocity", "turn", "turn_rate"});
    if (!word) throw step.error("do", "is missing; name the command");
    const Command command = read_command(*word, step);
    step.require_all_keys_used();
    try {
      check(command);
    } catch (const InputError& error) {
      throw step.error("do", error.what());
    }
    mission.push_back({*word, command});
  }
  return mission;
}

std::string outcome_text(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRunning:
      return "running";
    case Outcome::kFinished:
      return "finished";
    case Outcome::kTimedOut:
      return "timed out";
    case Outcome::kCancelled:
      return "cancelled";
    case Outcome::kCollided:
      return "collided";
  }
  return "";
}

}  // namespace tileflight::vehicle
