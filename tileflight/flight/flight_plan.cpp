#include "tileflight/flight/flight_plan.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "tileflight/flight/path.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/known_keys.h"

namespace tileflight::flight {
namespace {

constexpr std::uintmax_t kLargestFileBytes = 16 << 20;
constexpr double kMostFrames = 1e7;

/// A map of the file with what is needed to name a fault in it.
struct Section {
  YAML::Node map;
  std::string file;
  std::string name;  ///< "" for the whole file, else e.g. "waypoints[2]"

  InputError fault(const YAML::Node& at, const std::string& what) const {
    const int line = at.IsDefined() ? at.Mark().line : map.Mark().line;
    return {line < 0 ? file : file + ":" + std::to_string(line + 1), what};
  }
  std::string quoted(const std::string& key) const { return "'" + (name.empty() ? key : name + "." + key) + "'"; }
  YAML::Node at(const std::string& key) const {
    const YAML::Node& constant = map;  // a non-const [] would add the key
    return constant[key];
  }
};

void check_keys(const Section& section, const std::vector<std::string>& known) {
  if (!section.map.IsMap()) {
    throw section.fault(section.map,
                        (section.name.empty() ? "the file" : "'" + section.name + "'") + " must be a map of keys");
  }
  for (const auto& entry : section.map) {
    const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    throw section.fault(entry.first, section.quoted(key) + " is not a key here; did you mean '" +
                                         geometry::nearest_key(key, known) + "'?");
  }
}

double finite_number(const Section& section, const YAML::Node& node, const std::string& key) {
  double value = 0;
  if (!node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value)) {
    throw section.fault(node, section.quoted(key) + " must be a number");
  }
  return value;
}

std::optional<double> number(const Section& section, const std::string& key) {
  const YAML::Node node = section.at(key);
  if (!node.IsDefined() || node.IsNull()) return std::nullopt;
  return finite_number(section, node, key);
}

std::optional<double> positive(const Section& section, const std::string& key) {
  const std::optional<double> value = number(section, key);
  if (value && *value <= 0) throw section.fault(section.at(key), section.quoted(key) + " must be more than 0");
  return value;
}

std::optional<geometry::Vec3> vector(const Section& section, const std::string& key) {
  const YAML::Node node = section.at(key);
  if (!node.IsDefined() || node.IsNull()) return std::nullopt;
  if (!node.IsSequence() || node.size() != 3) {
    throw section.fault(node, section.quoted(key) + " must be [east, north, up], three numbers in metres");
  }
  geometry::Vec3 result;
  for (std::size_t i = 0; i < 3; ++i) result[static_cast<int>(i)] = finite_number(section, node[i], key);
  return result;
}

/// `NAME` or `NAME:-otherwise`, as in a shell.
std::string value_of_variable(const Section& section, const YAML::Node& node, const std::string& expression) {
  const std::size_t mark = expression.find(":-");
  const std::string name = expression.substr(0, mark);
  const char* value = std::getenv(name.c_str());
  if (value != nullptr && *value != '\0') return value;
  if (mark != std::string::npos) return expression.substr(mark + 2);
  throw section.fault(node, "the environment variable " + name + " is not set; set it and run again");
}

/// `${NAME}` and `${NAME:-otherwise}` filled in from the environment.
std::string filled_in(const Section& section, const YAML::Node& node) {
  std::string text = node.Scalar();
  for (std::size_t open = text.find("${"); open != std::string::npos; open = text.find("${", open)) {
    const std::size_t close = text.find('}', open);
    if (close == std::string::npos) throw section.fault(node, "'${' without '}' in \"" + text + "\"");
    const std::string value = value_of_variable(section, node, text.substr(open + 2, close - open - 2));
    text.replace(open, close - open + 1, value);
    open += value.size();
  }
  return text;
}

/// A path, relative to the file.
std::optional<std::filesystem::path> path(const Section& section, const std::string& key) {
  const YAML::Node node = section.at(key);
  if (!node.IsDefined() || node.IsNull()) return std::nullopt;
  if (!node.IsScalar() || node.Scalar().empty()) throw section.fault(node, section.quoted(key) + " must be a path");
  return (std::filesystem::path(section.file).parent_path() / filled_in(section, node)).lexically_normal();
}

Waypoint read_waypoint(const Section& section) {
  check_keys(section, {"position", "look_at", "yaw_deg", "pitch_deg", "roll_deg"});
  const std::optional<geometry::Vec3> position = vector(section, "position");
  if (!position)
    throw section.fault(section.map, section.quoted("position") + " is missing; give [east, north, up] in metres");
  Waypoint waypoint;
  waypoint.position = *position;
  waypoint.look_at = vector(section, "look_at");
  const std::optional<double> yaw = number(section, "yaw_deg"), pitch = number(section, "pitch_deg");
  if (waypoint.look_at && (yaw || pitch)) {
    throw section.fault(section.map,
                        "'" + section.name + "' has both look_at and yaw_deg or pitch_deg; keep one of the two");
  }
  waypoint.yaw_deg = yaw.value_or(0.0);
  waypoint.pitch_deg = pitch.value_or(0.0);
  waypoint.roll_deg = number(section, "roll_deg").value_or(0.0);
  return waypoint;
}

std::vector<Waypoint> read_waypoints(const Section& plan) {
  const YAML::Node list = plan.at("waypoints");
  if (!list.IsDefined() || list.IsNull()) return {};
  if (!list.IsSequence()) throw plan.fault(list, "'waypoints' must be a list");
  std::vector<Waypoint> waypoints;
  for (std::size_t i = 0; i < list.size(); ++i) {
    waypoints.push_back(read_waypoint({list[i], plan.file, "waypoints[" + std::to_string(i) + "]"}));
  }
  return waypoints;
}

std::optional<int> read_max_frames(const Section& plan) {
  const std::optional<double> value = positive(plan, "max_frames");
  if (!value) return std::nullopt;
  if (*value != std::floor(*value) || *value > kMostFrames)
    throw plan.fault(plan.at("max_frames"), "'max_frames' must be a whole number");
  return static_cast<int>(*value);
}

SpeedLimits read_limits(const Section& plan) {
  SpeedLimits limits;
  limits.speed_m_s = positive(plan, "speed_m_s").value_or(limits.speed_m_s);
  limits.acceleration_m_s2 = positive(plan, "acceleration_m_s2").value_or(limits.acceleration_m_s2);
  limits.yaw_rate_deg_s = positive(plan, "yaw_rate_deg_s").value_or(limits.yaw_rate_deg_s);
  return limits;
}

YAML::Node parse(const std::filesystem::path& file) {
  const std::string text = geometry::read_text(file, kLargestFileBytes);
  try {
    return YAML::Load(text);
  } catch (const YAML::Exception& fault) {
    throw InputError(file.string() + ":" + std::to_string(fault.mark.line + 1), "not valid YAML: " + fault.msg);
  }
}

/// A plan says where to fly in one way, and when to take pictures.
void check_whole(const Section& section, const FlightPlan& plan) {
  if (plan.camera.empty()) throw section.fault(section.map, "'camera' is missing; name the calibration file");
  if (plan.poses && !plan.waypoints.empty())
    throw section.fault(section.map, "has both 'trajectory' and 'waypoints'; keep one of the two");
  if (!plan.poses && plan.waypoints.size() < 2) {
    throw section.fault(section.map, "needs 'trajectory' (a TUM file) or at least two 'waypoints'");
  }
  if (!plan.poses && !plan.fps)
    throw section.fault(section.map, "'fps' is missing; waypoints have no frames of their own");
}

geometry::Trajectory sampled(const Path& path, double fps, double most_frames) {
  const double frames = std::min(most_frames, std::floor((path.end_s() - path.start_s()) * fps + 1e-9) + 1.0);
  if (frames > kMostFrames) throw InputError("flight", "more than ten million frames; lower 'fps' or set 'max_frames'");
  geometry::Trajectory trajectory;
  for (std::size_t i = 0; i < static_cast<std::size_t>(frames); ++i) {
    const double time_s = path.start_s() + static_cast<double>(i) / fps;
    trajectory.poses.push_back({time_s, path.pose(time_s)});
  }
  return trajectory;
}

}  // namespace

FlightPlan read_flight_plan(const std::filesystem::path& file) {
  const Section section{parse(file), file.string(), ""};
  check_keys(section, {"camera", "trajectory", "waypoints", "speed_m_s", "acceleration_m_s2", "yaw_rate_deg_s", "fps",
                       "max_frames"});
  FlightPlan plan;
  plan.camera = path(section, "camera").value_or("");
  if (const auto trajectory = path(section, "trajectory")) plan.poses = geometry::read_tum(*trajectory);
  plan.waypoints = read_waypoints(section);
  plan.limits = read_limits(section);
  plan.fps = positive(section, "fps");
  plan.max_frames = read_max_frames(section);
  check_whole(section, plan);
  return plan;
}

geometry::Trajectory frame_poses(const FlightPlan& plan) {
  const double most_frames = plan.max_frames ? *plan.max_frames : HUGE_VAL;
  if (!plan.fps) {
    if (!plan.poses) throw InputError("flight", "waypoints need 'fps'");
    geometry::Trajectory trajectory = *plan.poses;
    if (static_cast<double>(trajectory.size()) > most_frames)
      trajectory.poses.resize(static_cast<std::size_t>(most_frames));
    return trajectory;
  }
  const Path path = plan.poses ? path_through_poses(*plan.poses) : path_through_waypoints(plan.waypoints, plan.limits);
  return sampled(path, *plan.fps, most_frames);
}

}  // namespace tileflight::flight
