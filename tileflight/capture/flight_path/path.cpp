#include "tileflight/capture/flight_path/path.h"

#include <cmath>
#include <optional>
#include <string>
#include <variant>

#include "tileflight/capture/flight_path/cubic_spline.h"
#include "tileflight/capture/flight_path/orientation_curve.h"
#include "tileflight/capture/flight_path/speed_plan.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::flight_path {

SampleTimes make_sample_times(const char* sensor, double start_s, double end_s, double rate_hz) {
  constexpr double kHighestRate_hz = 1e5;
  if (!(rate_hz > 0.0 && rate_hz <= kHighestRate_hz))
    throw InputError(std::string(sensor) + " rate", "must lie between 0 and 100000 Hz");
  if (!(start_s <= end_s && std::isfinite(end_s - start_s)))
    throw InputError(std::string(sensor) + " time span", "ends before it starts");
  return {start_s, end_s, rate_hz};
}

namespace {

using geometry::Mat3;
using geometry::SE3;
using geometry::Vec3;

using geometry::kRadiansPerDegree;
/// Grid cells between two waypoints for speed planning.
constexpr int kCellsPerSegment = 64;
/// Between the grid's samples the bounds may be slightly exceeded.
constexpr double kSamplingMargin = 1.01;
/// Closer to the vertical than this, the direction to a look_at has no well-defined heading.
constexpr double kMinAngleFromVertical_rad = 1.0 * kRadiansPerDegree;
constexpr double kMinDistance_m = 1e-3;

/// A curve of camera poses over a parameter u.
struct Curve {
  CubicSpline<3> position;
  OrientationCurve orientation;

  Eigen::Quaterniond rotation(double u) const {
    if (const auto* blended = std::get_if<BlendedOrientation>(&orientation)) return blended->at(u);
    return std::get<TargetOrientation>(orientation).at(u, position.value(u));
  }
  SE3 pose(double u) const { return {rotation(u), position.value(u)}; }
  AngularMotion angular_motion(double u) const {
    if (const auto* blended = std::get_if<BlendedOrientation>(&orientation)) return blended->angular_motion(u);
    return std::get<TargetOrientation>(orientation)
        .angular_motion(u, {position.value(u), position.first_derivative(u), position.second_derivative(u)});
  }
};

std::string name_of(std::size_t waypoint) { return "waypoint " + std::to_string(waypoint + 1); }

double angle_from_vertical_rad(const Vec3& direction) {
  return std::atan2(direction.head<2>().norm(), std::abs(direction.z()));
}

void check_look_at(const Vec3& to_target, const std::string& where) {
  if (to_target.norm() < kMinDistance_m)
    throw InputError(where, "look_at is at the camera's position; move one of them");
  if (angle_from_vertical_rad(to_target) < kMinAngleFromVertical_rad) {
    throw InputError(
        where,
        "look_at is straight above or below the camera, so the heading is undefined; give yaw_deg and pitch_deg");
  }
}

void check(const std::vector<Waypoint>& waypoints) {
  if (waypoints.size() < 2) throw InputError("waypoints", "a path needs at least two");
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    const Waypoint& w = waypoints[i];
    const double sum = w.position.sum() + w.yaw_deg + w.pitch_deg + w.roll_deg + (w.look_at ? w.look_at->sum() : 0.0);
    if (!std::isfinite(sum)) throw InputError(name_of(i), "a number is not finite");
    if (w.look_at) check_look_at(*w.look_at - w.position, name_of(i));
    if (w.speed_m_s && !(std::isfinite(*w.speed_m_s) && *w.speed_m_s > 0.0))
      throw InputError(name_of(i), "speed_m_s must be more than 0");
    if (w.hold_s && !(std::isfinite(*w.hold_s) && *w.hold_s >= 0.0))
      throw InputError(name_of(i), "hold_s must be 0 or more");
    if (i > 0 && (w.position - waypoints[i - 1].position).norm() < kMinDistance_m) {
      throw InputError(name_of(i), "is at the same place as " + name_of(i - 1) + "; leave one of them out");
    }
  }
}

void check(const SpeedLimits& limits) {
  const auto positive = [](double value) { return std::isfinite(value) && value > 0.0; };
  if (!positive(limits.speed_m_s)) throw InputError("speed_m_s", "must be more than 0");
  if (!positive(limits.acceleration_m_s2)) throw InputError("acceleration_m_s2", "must be more than 0");
  if (!positive(limits.yaw_rate_deg_s)) throw InputError("yaw_rate_deg_s", "must be more than 0");
}

/// Flips signs so that consecutive quaternions lie in one half-space: q and -q are the same rotation, and the shorter
/// way is wanted.
std::vector<Eigen::Vector4d> align_quaternion_signs(const std::vector<Eigen::Quaterniond>& rotations) {
  std::vector<Eigen::Vector4d> result;
  for (const Eigen::Quaterniond& rotation : rotations) {
    const Eigen::Vector4d q = rotation.normalized().coeffs();
    result.push_back(!result.empty() && result.back().dot(q) < 0 ? Eigen::Vector4d(-q) : q);
  }
  return result;
}

Eigen::Quaterniond orientation_at(const Waypoint& w) {
  return w.look_at ? orientation_looking_along(*w.look_at - w.position, w.roll_deg)
                   : camera_orientation(w.yaw_deg, w.pitch_deg, w.roll_deg);
}

std::vector<double> centripetal_knots(const std::vector<Waypoint>& waypoints) {
  std::vector<double> knots{0.0};
  for (std::size_t i = 1; i < waypoints.size(); ++i) {
    knots.push_back(knots.back() + std::sqrt((waypoints[i].position - waypoints[i - 1].position).norm()));
  }
  return knots;
}

OrientationCurve orientation_along(const std::vector<Waypoint>& waypoints, const std::vector<double>& knots) {
  std::vector<Eigen::Quaterniond> rotations;
  std::vector<Eigen::Vector4d> targets;
  for (const Waypoint& w : waypoints) {
    rotations.push_back(orientation_at(w));
    if (w.look_at) targets.push_back((Eigen::Vector4d() << *w.look_at, w.roll_deg).finished());
  }
  if (targets.size() == waypoints.size()) return TargetOrientation{CubicSpline<4>(knots, targets)};
  return BlendedOrientation{CubicSpline<4>(knots, align_quaternion_signs(rotations))};
}

Curve curve_through(const std::vector<Waypoint>& waypoints) {
  const std::vector<double> knots = centripetal_knots(waypoints);
  std::vector<Vec3> positions;
  for (const Waypoint& w : waypoints) positions.push_back(w.position);
  return {CubicSpline<3>(knots, positions), orientation_along(waypoints, knots)};
}

std::vector<double> grid_over(const std::vector<double>& knots) {
  std::vector<double> grid{knots.front()};
  for (std::size_t i = 0; i + 1 < knots.size(); ++i) {
    const double step = (knots[i + 1] - knots[i]) / kCellsPerSegment;
    for (int k = 1; k < kCellsPerSegment; ++k) grid.push_back(knots[i] + k * step);
    grid.push_back(knots[i + 1]);
  }
  return grid;
}

/// Throws InputError if a moving target passes straight below or above the camera between waypoints.
void check_targets(const Curve& curve, const std::vector<double>& grid) {
  const auto* target = std::get_if<TargetOrientation>(&curve.orientation);
  if (target == nullptr) return;
  for (std::size_t k = 0; k < grid.size(); ++k) {
    const std::size_t segment = k / kCellsPerSegment;
    const Vec3 to_target = target->target_and_roll.value(grid[k]).head<3>() - curve.position.value(grid[k]);
    check_look_at(to_target, "between " + name_of(segment) + " and " + name_of(segment + 1));
  }
}

CurveBounds bounds_of(const Curve& curve, const std::vector<double>& grid) {
  CurveBounds bounds{grid, {}, {}, {}, {}, {}};
  for (std::size_t k = 0; k + 1 < grid.size(); ++k) {
    const double a = grid[k], b = grid[k + 1], middle = (a + b) / 2;
    const auto speed = [&](double u) { return curve.position.first_derivative(u).norm(); };
    const auto bend = [&](double u) { return curve.position.second_derivative(u).norm(); };
    const auto turn = [&](double u, double v) {
      return curve.rotation(u).angularDistance(curve.rotation(v)) / (v - u);
    };
    bounds.first_m.push_back(kSamplingMargin * std::max({speed(a), speed(middle), speed(b)}));
    bounds.second_m.push_back(kSamplingMargin * std::max(bend(a), bend(b)));
    bounds.rotation_rad.push_back(kSamplingMargin * std::max(turn(a, middle), turn(middle, b)));
  }
  return bounds;
}

/// Adds what the waypoints say of speed and rest.
void add_waypoint_limits(const std::vector<Waypoint>& waypoints, double speed_m_s, CurveBounds& bounds) {
  for (std::size_t i = 0; i < waypoints.size(); ++i) {
    if (waypoints[i].hold_s) bounds.rests.push_back({i * kCellsPerSegment, *waypoints[i].hold_s});
    if (i + 1 < waypoints.size())
      bounds.speed_m_s.insert(bounds.speed_m_s.end(), kCellsPerSegment, waypoints[i].speed_m_s.value_or(speed_m_s));
  }
}

}  // namespace

namespace {

/// A curve with the time law of a speed plan.
struct CurveMotion {
  Curve curve;
  std::optional<SpeedPlan> plan;  ///< nullopt: the curve's parameter is the time

  Progression at(double time_s) const {
    if (plan) return plan->at(time_s);
    const bool inside = time_s >= curve.position.start() && time_s <= curve.position.end();
    return {std::clamp(time_s, curve.position.start(), curve.position.end()), inside ? 1.0 : 0.0, 0.0};
  }

  double start_s() const { return plan ? 0.0 : curve.position.start(); }
  double end_s() const { return plan ? plan->duration_s() : curve.position.end(); }
  SE3 pose(double time_s) const { return curve.pose(at(time_s).u); }
  Vec3 velocity(double time_s) const {
    const Progression p = at(time_s);
    return curve.position.first_derivative(p.u) * p.rate;
  }
  Vec3 acceleration(double time_s) const {
    const Progression p = at(time_s);
    return curve.position.second_derivative(p.u) * (p.rate * p.rate) +
           curve.position.first_derivative(p.u) * p.acceleration;
  }
  AngularMotion angular_motion(double time_s) const {
    const Progression p = at(time_s);
    const AngularMotion turning = curve.angular_motion(p.u);
    return {turning.rate * p.rate, turning.acceleration * (p.rate * p.rate) + turning.rate * p.acceleration};
  }
};

/// B-splines over time; the camera is at rest before their start and after their end.
struct SplineMotion {
  BSpline<3> position;
  RotationSpline rotation;

  double start_s() const { return position.knots.start_s; }
  double end_s() const { return position.knots.end_s(); }
  bool is_inside(double time_s) const { return time_s >= start_s() && time_s <= end_s(); }
  SE3 pose(double time_s) const { return {rotation.at(time_s), position.value(time_s)}; }
  Vec3 velocity(double time_s) const {
    return is_inside(time_s) ? position.first_derivative(time_s) : Vec3(Vec3::Zero());
  }
  Vec3 acceleration(double time_s) const {
    return is_inside(time_s) ? position.second_derivative(time_s) : Vec3(Vec3::Zero());
  }
  AngularMotion angular_motion(double time_s) const {
    return is_inside(time_s) ? rotation.angular_motion(time_s) : AngularMotion{};
  }
};

}  // namespace

struct Path::Motion {
  std::variant<CurveMotion, SplineMotion> kind;

  template <class Ask>
  auto ask(const Ask& question) const {
    return std::visit(question, kind);
  }
};

Path::Path(std::shared_ptr<const Motion> motion) : motion_(std::move(motion)) {}

double Path::start_s() const {
  return motion_->ask([](const auto& motion) { return motion.start_s(); });
}
double Path::end_s() const {
  return motion_->ask([](const auto& motion) { return motion.end_s(); });
}
SE3 Path::pose(double time_s) const {
  return motion_->ask([&](const auto& motion) { return motion.pose(time_s); });
}
Vec3 Path::velocity(double time_s) const {
  return motion_->ask([&](const auto& motion) { return motion.velocity(time_s); });
}
Vec3 Path::acceleration(double time_s) const {
  return motion_->ask([&](const auto& motion) { return motion.acceleration(time_s); });
}
Vec3 Path::angular_velocity(double time_s) const {
  return motion_->ask([&](const auto& motion) { return motion.angular_motion(time_s).rate; });
}
Vec3 Path::angular_acceleration(double time_s) const {
  return motion_->ask([&](const auto& motion) { return motion.angular_motion(time_s).acceleration; });
}

Path path_through_waypoints(const std::vector<Waypoint>& waypoints, const SpeedLimits& limits) {
  check(waypoints);
  check(limits);
  Curve curve = curve_through(waypoints);
  const std::vector<double> grid = grid_over(curve.position.knots());
  check_targets(curve, grid);
  CurveBounds bounds = bounds_of(curve, grid);
  add_waypoint_limits(waypoints, limits.speed_m_s, bounds);
  const SpeedPlan plan(bounds, {limits.speed_m_s, limits.acceleration_m_s2, limits.yaw_rate_deg_s * kRadiansPerDegree});
  return Path(std::make_shared<const Path::Motion>(Path::Motion{CurveMotion{std::move(curve), plan}}));
}

Path path_through_poses(const geometry::Trajectory& trajectory) {
  if (trajectory.size() < 2) throw InputError("trajectory", "a path needs at least two poses");
  std::vector<double> times;
  std::vector<Vec3> positions;
  std::vector<Eigen::Quaterniond> rotations;
  for (const geometry::StampedPose& pose : trajectory.poses) {
    times.push_back(pose.time_s);
    positions.push_back(pose.T_local_camera.translation);
    rotations.push_back(pose.T_local_camera.rotation);
  }
  Curve curve{CubicSpline<3>(times, positions),
              BlendedOrientation{CubicSpline<4>(times, align_quaternion_signs(rotations))}};
  return Path(std::make_shared<const Path::Motion>(Path::Motion{CurveMotion{std::move(curve), std::nullopt}}));
}

Path path_along_splines(BSpline<3> position, RotationSpline rotation) {
  return Path(
      std::make_shared<const Path::Motion>(Path::Motion{SplineMotion{std::move(position), std::move(rotation)}}));
}

}  // namespace tileflight::flight_path
