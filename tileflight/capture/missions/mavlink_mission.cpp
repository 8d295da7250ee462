// Missions of MAVLink's ground stations: QGroundControl's plan (docs.qgroundcontrol.com, "Plan File Format") and the
// plain text of mavlink.io ("File Formats"). Both are lists of items: a command (MAV_CMD), a coordinate frame
// (MAV_FRAME) and seven parameters. Commands of navigation move the vehicle, the others act from the waypoint before
// them on.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>

#include "tileflight/capture/missions/mission.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::missions {
namespace {

using nlohmann::json;

/// Values of MAV_CMD.
enum Command : int {
  kWaypoint = 16,
  kLoiterForever = 17,
  kLoiterTurns = 18,
  kLoiterTime = 19,
  kReturnToLaunch = 20,
  kLand = 21,
  kTakeoff = 22,
  kLoiterToHeight = 31,
  kSplineWaypoint = 82,
  kVtolTakeoff = 84,
  kVtolLand = 85,
  kDelay = 93,
  kConditionYaw = 115,
  kJump = 177,
  kChangeSpeed = 178,
  kLandStart = 189,
  kRoiLocation = 195,
  kRoiNone = 197,
  kRoi = 201,
  kMountConfigure = 204,
  kMountControl = 205,
  kGimbalPitchYaw = 1000,
};

/// Commands that take pictures or set a camera. Images are taken at the rate of the flight file instead.
constexpr std::array kCameraCommands{202, 203, 206, 214, 530, 531, 532, 534, 2000, 2001, 2003, 2500, 2501};
/// The rounding of a corner where the item states no acceptance radius: the autopilots' default for multirotors.
constexpr double kAcceptance_m = 2.0;

/// An item of the list.
struct Item {
  int command = 0;
  int frame = 0;
  std::array<std::optional<double>, 7> params;  ///< nullopt: null or NaN, which leaves the choice to the autopilot
  int id = 0;                                   ///< number by which kJump names it
  bool is_of_survey = false;
  std::string where;

  std::optional<double> param(int number) const { return params[static_cast<std::size_t>(number - 1)]; }
  double param_or(int number, double fallback) const { return param(number).value_or(fallback); }
  /// Programs write 0, 0 or null for "where the vehicle is".
  bool has_place() const { return param_or(5, 0.0) != 0.0 || param_or(6, 0.0) != 0.0; }
};

/// Holds what the two files state beside their items.
struct Settings {
  bool uses_waypoint_yaw = false;  ///< PX4 turns to a waypoint's fourth parameter, ArduPilot ignores it
  std::optional<double> speed_m_s;
};

HeightAbove height_above(const Item& item) {
  switch (item.frame) {
    case 0:
    case 5:
      return HeightAbove::kSeaLevel;
    case 3:
    case 6:
      return HeightAbove::kTakeoff;
    case 10:
    case 11:
      return HeightAbove::kGround;
    default:
      throw InputError(item.where, "has the coordinate frame " + std::to_string(item.frame) +
                                       "; frames with a place are 0, 3 and 10 (sea level, take-off, terrain)");
  }
}

/// Flies the list once, item by item.
class Interpreter {
 public:
  Interpreter(std::vector<Item> items, Mission mission, const Settings& settings, const std::string& where)
      : items_(std::move(items)), mission_(std::move(mission)), settings_(settings), where_(where) {
    speed_m_s_ = settings.speed_m_s;
    for (std::size_t i = 0; i < items_.size(); ++i) number_of_.emplace(items_[i].id, i);
  }

  Mission run() && {
    constexpr int kMostSteps = 200000;
    int steps = 0;
    for (next_ = 0; next_ < items_.size() && !has_ended_;) {
      if (++steps > kMostSteps) throw InputError(where_, "repeats its items (command 177) without an end");
      const Item& item = items_[next_++];
      execute(item);
    }
    if (!mission_.waypoints.empty()) end_leg(std::nullopt);
    add_notes();
    return std::move(mission_);
  }

 private:
  void execute(const Item& item) {
    switch (item.command) {
      case kWaypoint:
      case kSplineWaypoint:
        return waypoint(item, item.param_or(1, 0.0));
      case kLoiterTime:
        return waypoint(item, item.param_or(1, 0.0), true);
      case kLoiterForever:
        has_ended_ = true;
        note("the flight ends where it loiters without a limit (command 17)");
        return waypoint(item, 0.0, true);
      case kLoiterTurns:
      case kLoiterToHeight:
        ++not_simulated_[item.command];
        return waypoint(item, 0.0);
      case kTakeoff:
      case kVtolTakeoff:
        return take_off(item);
      case kLand:
      case kVtolLand:
        note("the descent to the landing place is left out");
        if (item.has_place()) fly_to(level_place(item), {}, std::nullopt);
        return;
      case kReturnToLaunch:
        return return_to_launch();
      case kDelay:
        if (!mission_.waypoints.empty() && item.param_or(1, -1.0) > 0.0) stop(*item.param(1));
        return;
      case kJump:
        return jump(item);
      default:
        return set(item);
    }
  }

  /// Commands that do not move the vehicle.
  void set(const Item& item) {
    switch (item.command) {
      case kChangeSpeed:
        return change_speed(item);
      case kConditionYaw:
        if (item.param_or(4, 0.0) != 0.0) {
          ++not_simulated_[item.command];
        } else {
          yaw_of_leg_deg_ = item.param_or(1, 0.0);
          note("a heading of command 115 is kept up to the next waypoint");
        }
        return;
      case kRoi:
        if (item.param_or(1, 3.0) == 0.0) return look_ahead();
        if (item.param_or(1, 3.0) != 3.0) return count(item);
        return look_at(item);
      case kRoiLocation:
        return look_at(item);
      case kRoiNone:
        return look_ahead();
      case kMountControl:
        if (item.param_or(7, 2.0) != 2.0) return count(item);
        return tilt(item, item.param(3));
      case kGimbalPitchYaw:
        return tilt(item, item.param(2));
      case kMountConfigure:
      case kLandStart:
        return;  // they change nothing of the path or the view
      default:
        return count(item);
    }
  }

  void count(const Item& item) {
    const bool is_of_camera = std::ranges::find(kCameraCommands, item.command) != kCameraCommands.end();
    ++(is_of_camera ? of_camera_ : not_simulated_)[item.command];
  }

  void change_speed(const Item& item) {
    constexpr double kFastest_m_s = 1000.0;
    const double speed_m_s = item.param_or(2, -1.0);
    if (item.param_or(1, 1.0) > 1.0) return count(item);  // of climb and descent
    if (speed_m_s == -2.0) speed_m_s_ = settings_.speed_m_s;
    if (!(speed_m_s > 0.0)) return;
    if (speed_m_s > kFastest_m_s) throw InputError(item.where, base::formatted("sets a speed of %g m/s", speed_m_s));
    speed_m_s_ = speed_m_s;
  }

  void look_at(const Item& item) {
    require_on_earth(item.param_or(5, 0.0), item.param_or(6, 0.0), item.where);
    target_ = MissionPosition{*item.param(5), *item.param(6), item.param_or(7, 0.0), height_above(item)};
  }

  void look_ahead() { target_.reset(); }

  void tilt(const Item& item, std::optional<double> yaw_deg) {
    target_.reset();
    if (item.param(1)) pitch_ = {Pitch::Kind::kFixed, std::clamp(*item.param(1), -90.0, 90.0)};
    if (yaw_deg.value_or(0.0) == 0.0) {
      gimbal_yaw_deg_ = 0.0;
    } else {
      gimbal_yaw_deg_ = *yaw_deg;
      note("the gimbal's yaw is taken as relative to the vehicle's heading");
    }
  }

  /// The item's place; where it has none, the last waypoint's.
  MissionPosition place_of(const Item& item) const {
    const MissionPosition* const last = mission_.waypoints.empty() ? nullptr : &mission_.waypoints.back().position;
    if (!item.has_place()) {
      if (last == nullptr && !mission_.takeoff)
        throw InputError(item.where, "has no latitude and longitude, and no waypoint is before it");
      if (last == nullptr)
        return {mission_.takeoff->latitude_deg, mission_.takeoff->longitude_deg, item.param(7), height_above(item)};
      if (item.param_or(7, 0.0) == 0.0) return *last;
      return {last->latitude_deg, last->longitude_deg, item.param(7), height_above(item)};
    }
    if (!item.param(5) || !item.param(6)) throw InputError(item.where, "has only one of latitude and longitude");
    require_on_earth(*item.param(5), *item.param(6), item.where);
    if (!item.param(7)) {
      if (last == nullptr) throw InputError(item.where, "has no height, and no waypoint is before it");
      return {*item.param(5), *item.param(6), last->height_m, last->above};
    }
    return {*item.param(5), *item.param(6), item.param(7), height_above(item)};
  }

  /// The item's place at the height at which the vehicle flies.
  MissionPosition level_place(const Item& item) const {
    require_on_earth(item.param_or(5, 0.0), item.param_or(6, 0.0), item.where);
    if (mission_.waypoints.empty()) throw InputError(item.where, "lands before any waypoint");
    const MissionPosition& last = mission_.waypoints.back().position;
    return {*item.param(5), *item.param(6), last.height_m, last.above};
  }

  void waypoint(const Item& item, double hold_s, bool stops = false) {
    constexpr double kLongest_s = 3600.0;
    if (!(hold_s >= 0.0 && hold_s <= kLongest_s))
      throw InputError(item.where, base::formatted("holds for %g s; 0 to 3600 can be simulated", hold_s));
    const double radius_m = item.command == kWaypoint ? item.param_or(2, 0.0) : 0.0;
    Passing passing{Passing::Kind::kRounded, radius_m > 0.0 ? radius_m : kAcceptance_m, hold_s};
    if (stops || hold_s > 0.0) passing.kind = Passing::Kind::kStop;
    std::optional<double> yaw_deg;
    if (settings_.uses_waypoint_yaw) yaw_deg = item.param(4);
    if (!settings_.uses_waypoint_yaw && item.param_or(4, 0.0) != 0.0 && item.command == kWaypoint)
      note("headings in a waypoint's fourth parameter are not flown, since ArduPilot ignores them");
    fly_to(place_of(item), passing, yaw_deg, item.is_of_survey);
  }

  void take_off(const Item& item) {
    note("the climb from the ground is left out: the flight begins at the height of the take-off item");
    const std::optional<Takeoff>& home = mission_.takeoff;
    if (!home && !item.has_place()) return;
    if (home && !item.param(7)) throw InputError(item.where, "has no height");
    if (home) {
      fly_to({home->latitude_deg, home->longitude_deg, item.param(7), height_above(item)}, {}, std::nullopt);
    }
    constexpr double kSame_deg = 1e-6;
    const bool is_at_home = home && std::abs(item.param_or(5, 0.0) - home->latitude_deg) < kSame_deg &&
                            std::abs(item.param_or(6, 0.0) - home->longitude_deg) < kSame_deg;
    if (item.has_place() && !is_at_home) fly_to(place_of(item), {}, std::nullopt);
  }

  void return_to_launch() {
    note("the vehicle returns at the height of its last waypoint, and the descent is left out");
    if (mission_.waypoints.empty() || !mission_.takeoff) return;
    const MissionPosition& last = mission_.waypoints.back().position;
    fly_to({mission_.takeoff->latitude_deg, mission_.takeoff->longitude_deg, last.height_m, last.above}, {},
           std::nullopt);
  }

  void stop(double hold_s) {
    Passing& passing = mission_.waypoints.back().passing;
    passing.kind = Passing::Kind::kStop;
    passing.hold_s += std::min(hold_s, 3600.0);
  }

  void jump(const Item& item) {
    const double target = item.param_or(1, -1.0), times = item.param_or(2, 0.0);
    const auto found = number_of_.find(target >= 0.0 && target < 1e6 ? static_cast<int>(target) : -1);
    if (found == number_of_.end())
      throw InputError(item.where, base::formatted("jumps to the item %g, which does not exist", target));
    if (times < 0.0) note("an endless repetition (command 177) is flown once");
    int& done = jumps_[next_ - 1];
    if (done >= (times < 0.0 ? 1.0 : times)) return;
    ++done;
    next_ = found->second;
  }

  /// Settles the leg that ends here, since the commands before this waypoint act on it.
  void end_leg(std::optional<double> yaw_deg) {
    MissionWaypoint& from = mission_.waypoints.back();
    from.speed_m_s = speed_m_s_;
    from.target = target_;
    from.pitch = target_ ? Pitch{Pitch::Kind::kTarget, 0.0} : pitch_;
    if (from.pitch.kind == Pitch::Kind::kOpen && leg_is_of_survey_) from.pitch.kind = Pitch::Kind::kNadir;
    if (yaw_of_leg_deg_) yaw_deg = yaw_of_leg_deg_;
    if (yaw_deg) {
      from.heading = {Heading::Kind::kFixed, *yaw_deg + gimbal_yaw_deg_};
    } else if (target_) {
      from.heading = {Heading::Kind::kTarget, 0.0};
    } else {
      from.heading = {Heading::Kind::kAlong, gimbal_yaw_deg_};
    }
    yaw_of_leg_deg_.reset();
  }

  void fly_to(const MissionPosition& position, const Passing& passing, std::optional<double> yaw_deg,
              bool is_of_survey = false) {
    constexpr std::size_t kMostWaypoints = 20000;
    if (mission_.waypoints.size() > kMostWaypoints) throw InputError(where_, "has too many waypoints; divide it");
    leg_is_of_survey_ = is_of_survey;
    if (!mission_.waypoints.empty()) end_leg(yaw_deg);
    MissionWaypoint waypoint;
    waypoint.position = position;
    waypoint.passing = passing;
    mission_.waypoints.push_back(waypoint);
  }

  void note(const std::string& text) { base::add_distinct({text}, mission_.notes); }

  static std::string counted(const std::map<int, int>& commands) {
    std::string text;
    for (const auto& [command, times] : commands) {
      text += (text.empty() ? "" : ", ") + std::to_string(command) + " (" + std::to_string(times) +
              (times == 1 ? " time)" : " times)");
    }
    return text;
  }

  void add_notes() {
    if (!of_camera_.empty())
      note("images are taken at the flight's fps, not by the mission's camera commands: " + counted(of_camera_));
    if (!not_simulated_.empty()) note("commands that are not simulated: " + counted(not_simulated_));
  }

  std::vector<Item> items_;
  Mission mission_;
  Settings settings_;
  std::string where_;
  std::map<int, std::size_t> number_of_;
  std::map<std::size_t, int> jumps_;
  std::map<int, int> not_simulated_, of_camera_;  ///< command to how often
  std::size_t next_ = 0;
  bool has_ended_ = false, leg_is_of_survey_ = false;
  std::optional<double> speed_m_s_, yaw_of_leg_deg_;
  std::optional<MissionPosition> target_;
  Pitch pitch_;
  double gimbal_yaw_deg_ = 0.0;
};

/// A finite number, or nothing.
std::optional<double> number_at(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_number()) return std::nullopt;
  const double value = found->get<double>();
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

std::string text_at(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

int whole_number_at(const json& object, const char* key, const std::string& where) {
  const std::optional<double> value = number_at(object, key);
  if (!value || *value != std::floor(*value) || std::abs(*value) > 1e6)
    throw InputError(where, std::string("has no whole number '") + key + "'");
  return static_cast<int>(*value);
}

Item read_item(const json& object, const std::string& where) {
  Item item;
  item.where = where;
  item.command = whole_number_at(object, "command", where);
  item.frame = whole_number_at(object, "frame", where);
  item.id = object.contains("doJumpId") ? whole_number_at(object, "doJumpId", where) : -1;
  const auto params = object.find("params");
  if (params == object.end() || !params->is_array() || params->size() != item.params.size())
    throw InputError(where, "has no list 'params' of seven numbers");
  for (std::size_t i = 0; i < item.params.size(); ++i) {
    const json& value = (*params)[i];
    if (!value.is_null() && !value.is_number()) throw InputError(where, "has a parameter that is no number");
    if (value.is_number() && std::isfinite(value.get<double>())) item.params[i] = value.get<double>();
  }
  return item;
}

/// The lens of a survey's CameraCalc; nullopt for one without ("Manual (no camera specs)").
std::optional<SurveyCamera> survey_camera(const json& transects) {
  constexpr double kSmallest_px = 16.0, kLargest_px = 65536.0;
  const auto calc = transects.find("CameraCalc");
  if (calc == transects.end() || !calc->is_object()) return std::nullopt;
  const auto width = number_at(*calc, "ImageWidth"), height = number_at(*calc, "ImageHeight");
  const auto sensor_mm = number_at(*calc, "SensorWidth"), other_mm = number_at(*calc, "SensorHeight");
  const auto focal_mm = number_at(*calc, "FocalLength");
  if (!width || !height || !sensor_mm || !other_mm || !focal_mm) return std::nullopt;
  for (const double side : {*width, *height})
    if (!(side >= kSmallest_px && side <= kLargest_px)) return std::nullopt;
  if (!(*sensor_mm > 0.0 && *other_mm > 0.0 && *focal_mm > 0.0)) return std::nullopt;
  const auto landscape = calc->find("Landscape");
  const bool is_upright = landscape != calc->end() && landscape->is_boolean() && !landscape->get<bool>();
  const double across_mm = is_upright ? *other_mm : *sensor_mm;
  SurveyCamera camera{static_cast<int>(is_upright ? *height : *width), static_cast<int>(is_upright ? *width : *height),
                      2.0 * std::atan(across_mm / 2.0 / *focal_mm) * 180.0 / std::numbers::pi};
  return camera.fov_deg > 1.0 && camera.fov_deg < 170.0 ? std::optional(camera) : std::nullopt;
}

/// The list of a plan's items, with those of its complex items in their places.
class PlanItems {
 public:
  PlanItems(const json& list, std::string where, Mission& mission) : where_(std::move(where)), mission_(mission) {
    for (const json& object : list) add(object);
  }

  std::vector<Item> take() && { return std::move(items_); }

 private:
  void add(const json& object) {
    constexpr std::size_t kMostItems = 100000;
    const std::string where = where_ + ", item " + std::to_string(++count_);
    if (!object.is_object()) throw InputError(where, "is no JSON object");
    if (items_.size() > kMostItems) throw InputError(where_, "has more than 100000 items; divide it");
    if (text_at(object, "type") == "ComplexItem") return add_complex(object, where);
    items_.push_back(read_item(object, where));
  }

  void add_complex(const json& object, const std::string& where) {
    const std::string kind = text_at(object, "complexItemType");
    if (kind == "fwLandingPattern" || kind == "vtolLandingPattern") {
      mission_.notes.push_back("the landing pattern is left out");
      return;
    }
    const auto transects = object.find("TransectStyleComplexItem");
    const json empty;
    const json& style = transects != object.end() ? *transects : empty;
    const auto list = style.is_object() ? style.find("Items") : style.end();
    if (!style.is_object() || list == style.end() || !list->is_array()) {
      throw InputError(where, "is a complex item of type '" + kind.substr(0, 40) +
                                  "' without the waypoints that it was planned to: upload it to a (simulated) vehicle "
                                  "with QGroundControl, download it again and save that plan");
    }
    if (!mission_.camera) mission_.camera = survey_camera(style);
    std::size_t number = 0;
    for (const json& part : *list) {
      const std::string place = where + ", part " + std::to_string(++number);
      if (!part.is_object()) throw InputError(place, "is no JSON object");
      items_.push_back(read_item(part, place));
      items_.back().is_of_survey = kind != "StructureScan";
    }
  }

  std::string where_;
  Mission& mission_;
  std::vector<Item> items_;
  std::size_t count_ = 0;
};

/// [latitude, longitude, height above sea level].
std::optional<Takeoff> planned_home(const json& mission, const std::string& where) {
  const auto home = mission.find("plannedHomePosition");
  if (home == mission.end() || !home->is_array() || home->size() < 2) return std::nullopt;
  const auto number = [&](std::size_t i) {
    if (i >= home->size() || !(*home)[i].is_number()) return std::optional<double>();
    return std::optional((*home)[i].get<double>());
  };
  if (!number(0) || !number(1) || (*number(0) == 0.0 && *number(1) == 0.0)) return std::nullopt;
  require_on_earth(*number(0), *number(1), where + ", plannedHomePosition");
  return Takeoff{*number(0), *number(1), number(2)};
}

}  // namespace

Mission read_plan(std::string_view text, const std::string& where) {
  constexpr int kArduPilot = 3, kFixedWing = 1;
  const json plan = json::parse(text, nullptr, false);
  if (plan.is_discarded() || !plan.is_object()) throw InputError(where, "is not valid JSON; is it cut off?");
  if (text_at(plan, "fileType") != "Plan")
    throw InputError(where, "is JSON of the type '" + text_at(plan, "fileType").substr(0, 40) +
                                "', not a plan of QGroundControl: open it there and save it again");
  const auto mission_object = plan.find("mission");
  if (mission_object == plan.end() || !mission_object->is_object()) throw InputError(where, "has no 'mission'");
  const auto list = mission_object->find("items");
  if (list == mission_object->end() || !list->is_array()) throw InputError(where, "has no list 'items'");
  Mission mission;
  mission.format = "a QGroundControl plan";
  mission.takeoff = planned_home(*mission_object, where);
  std::vector<Item> items = PlanItems(*list, where, mission).take();
  Settings settings;
  settings.uses_waypoint_yaw = number_at(*mission_object, "firmwareType").value_or(0.0) != kArduPilot;
  const bool is_plane = number_at(*mission_object, "vehicleType").value_or(0.0) == kFixedWing;
  const auto speed = number_at(*mission_object, is_plane ? "cruiseSpeed" : "hoverSpeed");
  if (speed && *speed > 0.0) settings.speed_m_s = *speed;
  for (const auto& [key, names] : {std::pair{"geoFence", "geofence"}, std::pair{"rallyPoints", "rally points"}}) {
    const auto part = plan.find(key);
    if (part == plan.end() || !part->is_object()) continue;
    const bool holds_some =
        std::ranges::any_of(*part, [](const json& value) { return value.is_array() && !value.empty(); });
    if (holds_some) mission.notes.push_back(std::string("the ") + names + " of the plan is not used");
  }
  return Interpreter(std::move(items), std::move(mission), settings, where).run();
}

Mission read_waypoint_list(std::string_view text, const std::string& where) {
  constexpr std::size_t kFields = 12;
  Mission mission;
  mission.format = "a mission as plain text (QGC WPL)";
  std::vector<Item> items;
  bool is_first = true;
  base::for_each_row(base::strip_byte_order_mark(text), where, " \t", [&](const base::TextRow& row) {
    if (is_first) {
      is_first = false;
      if (row.fields.size() < 3 || row.fields[2] != "110")
        throw InputError(row.where, "is not of version 110; save the mission with a current ground station");
      return;
    }
    if (row.fields.size() < kFields)
      throw InputError(row.where, "has " + std::to_string(row.fields.size()) + " fields instead of 12; is it cut off?");
    std::array<double, kFields> numbers{};
    for (std::size_t i = 0; i < kFields; ++i) {
      const auto number = base::parse_number<double>(row.fields[i]);
      if (!number) throw InputError(row.where, "'" + std::string(row.fields[i].substr(0, 40)) + "' is no number");
      numbers[i] = *number;
    }
    Item item;
    item.where = row.where;
    for (const std::size_t i : {std::size_t{0}, std::size_t{2}, std::size_t{3}})
      if (!(std::abs(numbers[i]) <= 1e6) || numbers[i] != std::floor(numbers[i]))
        throw InputError(row.where, "its index, frame and command must be whole numbers");
    item.id = static_cast<int>(numbers[0]);
    item.frame = static_cast<int>(numbers[2]);
    item.command = static_cast<int>(numbers[3]);
    for (std::size_t i = 0; i < item.params.size(); ++i)
      if (std::isfinite(numbers[4 + i])) item.params[i] = numbers[4 + i];
    const bool is_home = items.empty() && !mission.takeoff && item.id == 0 && item.command == kWaypoint &&
                         item.frame == 0 && item.has_place();
    if (!is_home) return items.push_back(item);
    require_on_earth(item.param_or(5, 0.0), item.param_or(6, 0.0), item.where);
    mission.takeoff = Takeoff{item.param_or(5, 0.0), item.param_or(6, 0.0), item.param(7)};
    mission.notes.emplace_back("item 0 is taken as the take-off place, as ArduPilot's ground stations write it");
  });
  return Interpreter(std::move(items), std::move(mission), {}, where).run();
}

}  // namespace tileflight::missions
