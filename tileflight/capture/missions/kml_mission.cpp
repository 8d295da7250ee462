// KML documents: DJI's WPML (developer.dji.com, Cloud API, "DJI WPML": template.kml and waylines.wpml), whose elements
// stand in KML's, and plain routes (OGC KML 2.3).
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "tileflight/capture/missions/mission.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/xml_stream.h"

namespace tileflight::missions {
namespace {

/// An element: its name without prefix, its children, and if it has none, its text.
struct Element {
  std::string name, text;
  std::vector<Element> children;

  const Element* child(std::string_view wanted) const {
    const auto found = std::ranges::find(children, wanted, &Element::name);
    return found == children.end() ? nullptr : &*found;
  }
  std::string_view text_of(std::string_view wanted) const {
    const Element* const found = child(wanted);
    return found == nullptr ? std::string_view() : base::trim(found->text);
  }
  /// nullopt: there is none, or it is no number.
  std::optional<double> number_of(std::string_view wanted) const { return base::parse_finite_number(text_of(wanted)); }
  bool says_yes(std::string_view wanted) const { return text_of(wanted) == "1"; }
};

template <class Visit>
void for_each_element(const Element& element, const Visit& visit) {
  visit(element);
  for (const Element& child : element.children) for_each_element(child, visit);
}

/// The document's root. Throws InputError if it is damaged: a mission that is cut off would end early.
Element read_document(std::string_view text, const std::string& where) {
  constexpr std::size_t kMostElements = 2000000, kLongestText = std::size_t{16} << 20;
  Element document;
  std::vector<Element*> open{&document};
  std::size_t count = 0;
  flight_logs::XmlEvents events;
  events.longest_text = kLongestText;
  events.start = [&](std::string_view name, const flight_logs::XmlEvents::Attributes&) {
    if (++count > kMostElements) throw InputError(where, "has more than two million elements");
    open.back()->children.push_back({std::string(name), {}, {}});
    open.push_back(&open.back()->children.back());
    return true;
  };
  events.end = [&](std::string_view, std::string_view characters) {
    if (open.back()->children.empty()) open.back()->text = characters;
    open.pop_back();
    return true;
  };
  const std::string fault = flight_logs::read_xml(text, where, events);
  if (!fault.empty()) throw InputError(where, "is damaged at " + fault + ": a part of the mission would be missing");
  if (document.children.empty() || document.children.front().name != "kml")
    throw InputError(where, "is XML but not KML: its root element is <" +
                                (document.children.empty() ? "" : document.children.front().name.substr(0, 40)) + ">");
  return std::move(document.children.front());
}

/// `longitude,latitude` or `longitude,latitude,height`.
MissionPosition parse_coordinates(std::string_view tuple, const std::string& where) {
  std::array<std::optional<double>, 3> numbers;
  std::size_t count = 0;
  for (std::string_view rest = tuple; count < numbers.size();) {
    const std::size_t comma = rest.find(',');
    numbers[count++] = base::parse_finite_number(rest.substr(0, comma));
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
    if (count == numbers.size()) count = numbers.size() + 1;  // a fourth number
  }
  const bool is_place = count >= 2 && count <= numbers.size() && numbers[0] && numbers[1] && (count == 2 || numbers[2]);
  if (!is_place)
    throw InputError(where, "'" + std::string(tuple.substr(0, 60)) + "' is no longitude,latitude[,height]");
  require_on_earth(*numbers[1], *numbers[0], where);
  return {*numbers[1], *numbers[0], numbers[2], HeightAbove::kGround};
}

/// Holds what a wayline says for all its waypoints.
struct Wayline {
  const Element& folder;
  HeightAbove above = HeightAbove::kTakeoff;
  bool is_template = false;
  std::string where{};
};

/// WPML's actions and parameters as a mission.
class WpmlReader {
 public:
  WpmlReader(const Element& document, const std::string& where) : where_(where) {
    mission_.format = "a mission of DJI (WPML)";
    for_each_element(document, [&](const Element& element) {
      if (element.name == "missionConfig") read_takeoff(element);
    });
    std::size_t waylines = 0;
    for_each_element(document, [&](const Element& element) {
      if (base::to_lower(element.name) != "folder") return;
      ++waylines;
      read_wayline(element);
    });
    if (waylines > 1) note("its " + std::to_string(waylines) + " waylines are flown one after the other");
    if (mission_.waypoints.empty())
      throw InputError(where,
                       "holds no waypoints (a mapping template has only its area): give the .kmz that holds "
                       "waylines.wpml");
    settle_headings();
    settle_pitches();
    add_notes();
  }

  Mission take() && { return std::move(mission_); }

 private:
  void note(const std::string& text) { base::add_distinct({text}, mission_.notes); }

  /// "latitude,longitude,height"; of the height DJI does not say above what it is.
  void read_takeoff(const Element& config) {
    const std::string_view text = config.text_of("takeOffRefPoint");
    if (text.empty()) return;
    const std::size_t first = text.find(','), second = text.find(',', first + 1);
    const auto latitude = base::parse_finite_number(text.substr(0, first));
    const auto longitude = first == std::string_view::npos
                               ? std::nullopt
                               : base::parse_finite_number(text.substr(first + 1, second - first - 1));
    if (!latitude || !longitude)
      throw InputError(where_, "'" + std::string(text.substr(0, 60)) + "' in takeOffRefPoint is no latitude,longitude");
    if (*latitude == 0.0 && *longitude == 0.0) return;  // what DJI Pilot 2 writes for a place that is not set
    require_on_earth(*latitude, *longitude, where_ + ", takeOffRefPoint");
    mission_.takeoff = Takeoff{*latitude, *longitude, std::nullopt};
  }

  HeightAbove height_mode(const Element& folder, bool is_template) {
    const Element* const system = folder.child("waylineCoordinateSysParam");
    const std::string_view word =
        is_template ? (system != nullptr ? system->text_of("heightMode") : "") : folder.text_of("executeHeightMode");
    if (word == "WGS84") return HeightAbove::kEllipsoid;
    if (word == "EGM96") return HeightAbove::kSeaLevel;
    if (word == "relativeToStartPoint") return HeightAbove::kTakeoff;
    if (word == "aboveGroundLevel" || word == "realTimeFollowSurface") return HeightAbove::kGround;
    throw InputError(where_, "its " + std::string(is_template ? "heightMode" : "executeHeightMode") + " is '" +
                                 std::string(word.substr(0, 40)) +
                                 "', not WGS84, EGM96, relativeToStartPoint, aboveGroundLevel or "
                                 "realTimeFollowSurface");
  }

  void read_wayline(const Element& folder) {
    const bool has_waypoints = std::ranges::any_of(folder.children, [](const Element& element) {
      return element.name == "Placemark" && element.child("Point") != nullptr;
    });
    if (!has_waypoints) return;
    Wayline wayline{folder};
    wayline.is_template = folder.child("executeHeightMode") == nullptr;
    wayline.above = height_mode(folder, wayline.is_template);
    if (const Element* start = folder.child("startActionGroup")) {
      MissionWaypoint ignored;
      for (const Element& action : start->children)
        if (action.name == "action") act(action, ignored);
    }
    std::size_t number = 0;
    for (const Element& placemark : folder.children) {
      if (placemark.name != "Placemark" || placemark.child("Point") == nullptr) continue;
      wayline.where = where_ + ", waypoint " + std::to_string(++number);
      add_waypoint(placemark, wayline);
    }
  }

  void add_waypoint(const Element& placemark, const Wayline& wayline) {
    constexpr std::size_t kMostWaypoints = 20000;
    if (mission_.waypoints.size() > kMostWaypoints) throw InputError(where_, "has too many waypoints; divide it");
    MissionWaypoint waypoint;
    waypoint.position = parse_coordinates(placemark.child("Point")->text_of("coordinates"), wayline.where);
    waypoint.position.above = wayline.above;
    waypoint.position.height_m = height_of(placemark, wayline);
    if (!waypoint.position.height_m) throw InputError(wayline.where, "has no height");
    const bool has_global_speed = placemark.says_yes("useGlobalSpeed");
    waypoint.speed_m_s = has_global_speed ? std::nullopt : placemark.number_of("waypointSpeed");
    if (!waypoint.speed_m_s) waypoint.speed_m_s = wayline.folder.number_of("autoFlightSpeed");
    if (waypoint.speed_m_s && !(*waypoint.speed_m_s > 0.0)) waypoint.speed_m_s.reset();
    waypoint.passing = passing_of(placemark, wayline);
    set_heading(placemark, wayline, waypoint);
    set_pitch(placemark, waypoint);
    for (const Element& group : placemark.children) {
      if (group.name != "actionGroup") continue;
      for (const Element& action : group.children)
        if (action.name == "action") act(action, waypoint);
    }
    waypoint.pitch.deg = pitch_deg_.value_or(waypoint.pitch.deg);
    if (waypoint.pitch.kind != Pitch::Kind::kBlend && pitch_deg_) waypoint.pitch.kind = Pitch::Kind::kFixed;
    if (next_pitch_deg_) pitch_deg_ = next_pitch_deg_;
    next_pitch_deg_.reset();
    mission_.waypoints.push_back(waypoint);
  }

  static std::optional<double> height_of(const Element& placemark, const Wayline& wayline) {
    if (!wayline.is_template) return placemark.number_of("executeHeight");
    if (placemark.says_yes("useGlobalHeight")) return wayline.folder.number_of("globalHeight");
    if (wayline.above == HeightAbove::kEllipsoid) return placemark.number_of("ellipsoidHeight");
    return placemark.number_of("height");
  }

  Passing passing_of(const Element& placemark, const Wayline& wayline) {
    const Element* turn = placemark.child("waypointTurnParam");
    const bool is_global = turn == nullptr || placemark.says_yes("useGlobalTurnParam");
    const std::string_view mode =
        is_global ? wayline.folder.text_of("globalWaypointTurnMode") : turn->text_of("waypointTurnMode");
    const bool is_straight = placemark.child("useStraightLine") != nullptr
                                 ? placemark.says_yes("useStraightLine")
                                 : wayline.folder.says_yes("globalUseStraightLine");
    const double damping_m = turn == nullptr ? 0.0 : turn->number_of("waypointTurnDampingDist").value_or(0.0);
    const Passing rounded{Passing::Kind::kRounded, damping_m > 0.0 ? damping_m : Passing{}.distance_m, 0.0};
    const Passing stop{Passing::Kind::kStop, 0.0, 0.0}, curve{Passing::Kind::kCurve, 0.0, 0.0};
    if (mode == "coordinateTurn") return rounded;
    if (mode == "toPointAndStopWithDiscontinuityCurvature") return stop;
    if (mode == "toPointAndStopWithContinuityCurvature") return stop;
    if (mode == "toPointAndPassWithContinuityCurvature") return is_straight ? rounded : curve;
    if (!mode.empty()) note("the turn mode '" + std::string(mode.substr(0, 60)) + "' is unknown: corners are rounded");
    return rounded;
  }

  void set_heading(const Element& placemark, const Wayline& wayline, MissionWaypoint& waypoint) {
    const Element* param = placemark.child("waypointHeadingParam");
    if (param == nullptr || placemark.says_yes("useGlobalHeadingParam"))
      param = wayline.folder.child("globalWaypointHeadingParam");
    if (param == nullptr) return;
    const std::string_view mode = param->text_of("waypointHeadingMode");
    const std::optional<double> angle = param->number_of("waypointHeadingAngle");
    const bool is_switched_off = param->text_of("waypointHeadingAngleEnable") == "0";
    if (mode == "smoothTransition") {
      waypoint.heading = {Heading::Kind::kBlend, angle.value_or(0.0)};
      if (!angle || is_switched_off) turns_through_.push_back(mission_.waypoints.size());
    } else if (mode == "fixed" && angle && !is_switched_off) {
      waypoint.heading = {Heading::Kind::kFixed, *angle};
    } else if (mode == "fixed" && !mission_.waypoints.empty() &&
               mission_.waypoints.back().heading.kind == Heading::Kind::kFixed) {
      waypoint.heading = mission_.waypoints.back().heading;
    } else if (mode == "towardPOI") {
      set_target(param->text_of("waypointPoiPoint"), wayline.where, waypoint);
    } else if (mode == "manually") {
      note("headings that the pilot turns by hand follow the direction of flight");
    } else if (mode == "fixed") {
      note("a fixed heading without an angle follows the direction of flight");
    }
  }

  /// "latitude,longitude,height": the height is not used, as DJI's documentation says.
  void set_target(std::string_view text, const std::string& where, MissionWaypoint& waypoint) {
    const std::size_t first = text.find(','), second = text.find(',', first + 1);
    const auto latitude = base::parse_finite_number(text.substr(0, first));
    const auto longitude = first == std::string_view::npos
                               ? std::nullopt
                               : base::parse_finite_number(text.substr(first + 1, second - first - 1));
    if (!latitude || !longitude) throw InputError(where, "looks at a point that is not stated (waypointPoiPoint)");
    require_on_earth(*latitude, *longitude, where + ", waypointPoiPoint");
    waypoint.heading = {Heading::Kind::kTarget, 0.0};
    waypoint.target = MissionPosition{*latitude, *longitude, std::nullopt, HeightAbove::kGround};
  }

  void set_pitch(const Element& placemark, MissionWaypoint& waypoint) {
    const Element* const gimbal = placemark.child("waypointGimbalHeadingParam");
    auto angle = gimbal == nullptr ? std::nullopt : gimbal->number_of("waypointGimbalPitchAngle");
    if (!angle) angle = placemark.number_of("gimbalPitchAngle");
    stated_pitch_deg_.push_back(angle);
    waypoint.pitch = {};
  }

  void act(const Element& action, MissionWaypoint& waypoint) {
    const std::string_view what = action.text_of("actionActuatorFunc");
    const Element* const params = action.child("actionActuatorFuncParam");
    const Element none;
    const Element& param = params == nullptr ? none : *params;
    if (what == "gimbalRotate") {
      rotate_gimbal(param);
    } else if (what == "gimbalEvenlyRotate") {
      const auto angle = param.number_of("gimbalPitchRotateAngle");
      if (!angle) return;
      waypoint.pitch = {Pitch::Kind::kBlend, pitch_deg_.value_or(0.0)};
      if (!pitch_deg_) pitch_deg_ = 0.0;
      next_pitch_deg_ = *angle;
      acts_on_gimbal_ = true;
    } else if (what == "rotateYaw") {
      const auto heading = param.number_of("aircraftHeading");
      if (heading) waypoint.heading = {Heading::Kind::kFixed, *heading};
      waypoint.passing.kind = Passing::Kind::kStop;
    } else if (what == "hover") {
      constexpr double kLongest_s = 3600.0;
      waypoint.passing.kind = Passing::Kind::kStop;
      waypoint.passing.hold_s += std::clamp(param.number_of("hoverTime").value_or(0.0), 0.0, kLongest_s);
    } else {
      ++other_actions_[std::string(what.substr(0, 40))];
    }
  }

  void rotate_gimbal(const Element& param) {
    if (param.text_of("gimbalRotateMode") == "relativeAngle") note("gimbal angles relative to the last are not flown");
    if (param.says_yes("gimbalYawRotateEnable") && param.number_of("gimbalYawRotateAngle").value_or(0.0) != 0.0)
      note("the gimbal's own yaw is not flown");
    const auto angle = param.number_of("gimbalPitchRotateAngle");
    if (!angle || param.text_of("gimbalPitchRotateEnable") == "0") return;
    if (param.text_of("gimbalRotateMode") == "relativeAngle") return;
    acts_on_gimbal_ = true;
    pitch_deg_ = std::clamp(*angle, -90.0, 90.0);
  }

  /// Waypoints that turn smoothly without an angle of their own are passed on the turn from the one before to the one
  /// behind that have one.
  void settle_headings() {
    std::vector<MissionWaypoint>& all = mission_.waypoints;
    std::vector<bool> has_angle(all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
      const Heading::Kind kind = all[i].heading.kind;
      has_angle[i] = kind == Heading::Kind::kBlend || kind == Heading::Kind::kFixed;
    }
    for (const std::size_t i : turns_through_) has_angle[i] = false;
    std::optional<std::size_t> before;
    for (std::size_t i = 0, behind = 0, open = 0; i < all.size(); ++i) {
      if (has_angle[i]) before = i;
      if (open >= turns_through_.size() || turns_through_[open] != i) continue;
      ++open;
      for (behind = std::max(behind, i); behind < all.size() && !has_angle[behind];) ++behind;
      const bool has_next = behind < all.size();
      if (!before && !has_next) {
        all[i].heading = {};
      } else if (!before || !has_next) {
        all[i].heading.deg = all[before ? *before : behind].heading.deg;
      } else {
        const double first = all[*before].heading.deg;
        const double share = static_cast<double>(i - *before) / static_cast<double>(behind - *before);
        all[i].heading.deg = first + share * std::remainder(all[behind].heading.deg - first, 360.0);
      }
    }
  }

  /// Without actions on the gimbal its pitch is that stated with each waypoint, where any is.
  void settle_pitches() {
    const bool states_any =
        std::ranges::any_of(stated_pitch_deg_, [](const auto& angle) { return angle.value_or(0.0) != 0.0; });
    if (acts_on_gimbal_ || !states_any) return;
    for (std::size_t i = 0; i < mission_.waypoints.size(); ++i)
      mission_.waypoints[i].pitch = {Pitch::Kind::kBlend, std::clamp(stated_pitch_deg_[i].value_or(0.0), -90.0, 90.0)};
  }

  void add_notes() {
    if (other_actions_.empty()) return;
    std::string text;
    for (const auto& [name, times] : other_actions_) {
      text += (text.empty() ? "" : ", ") + (name.empty() ? std::string("without a name") : name) + " (" +
              std::to_string(times) + (times == 1 ? " time)" : " times)");
    }
    note("images are taken at the flight's fps; actions that are not simulated: " + text);
  }

  std::string where_;
  Mission mission_;
  std::optional<double> pitch_deg_, next_pitch_deg_;
  std::vector<std::size_t> turns_through_;               ///< waypoints that turn smoothly without an angle
  std::vector<std::optional<double>> stated_pitch_deg_;  ///< of each waypoint
  bool acts_on_gimbal_ = false;
  std::map<std::string, int> other_actions_;
};

/// Sets what KML's altitudeMode says of a height. Google Earth clamps to the ground where nothing is said.
void apply_mode(std::string_view mode, MissionPosition& position, const std::string& where) {
  if (mode == "absolute") {
    position.above = HeightAbove::kSeaLevel;
    if (!position.height_m) throw InputError(where, "is absolute and has a point without a height");
  } else if (mode == "relativeToGround") {
    position.height_m = position.height_m.value_or(0.0);
  } else if (mode.empty() || mode == "clampToGround") {
    position.height_m.reset();
  } else {
    throw InputError(where, "has heights of the mode '" + std::string(mode.substr(0, 40)) +
                                "'; absolute, relativeToGround and clampToGround can be flown");
  }
}

/// A route of lines, or where there is none, of points in their order.
class RouteReader {
 public:
  RouteReader(const Element& document, const std::string& where) : where_(where) {
    mission_.format = "a KML route";
    read(document);
    if (has_track_ && lines_.empty())
      throw InputError(where, "is a recorded track (gx:Track), not a route: ingest takes it as telemetry");
    if (lines_.size() > 1)
      mission_.notes.push_back("its " + std::to_string(lines_.size()) + " lines are flown one after the other");
    for (const Element* line : lines_) add(*line);
    if (!lines_.empty() && !points_.empty())
      mission_.notes.push_back(std::to_string(points_.size()) + " points beside the line are not flown");
    if (lines_.empty())
      for (const Element* point : points_) add(*point);
    if (mission_.waypoints.empty())
      throw InputError(where, "holds neither a LineString nor Points: draw the route as a path");
  }

  Mission take() && { return std::move(mission_); }

 private:
  void read(const Element& document) {
    for_each_element(document, [&](const Element& element) {
      if (element.name == "LineString") lines_.push_back(&element);
      if (element.name == "Point") points_.push_back(&element);
      if (element.name == "Track") has_track_ = true;
    });
  }

  void add(const Element& geometry) {
    std::string_view tuples = geometry.text_of("coordinates");
    while (true) {
      const std::string_view tuple = base::take_field(tuples, " \t\r\n");
      if (tuple.empty()) return;
      const std::string where = where_ + ", point " + std::to_string(mission_.waypoints.size() + 1);
      MissionWaypoint waypoint;
      waypoint.position = parse_coordinates(tuple, where);
      apply_mode(geometry.text_of("altitudeMode"), waypoint.position, where);
      mission_.waypoints.push_back(waypoint);
    }
  }

  std::string where_;
  Mission mission_;
  std::vector<const Element*> lines_, points_;
  bool has_track_ = false;
};

}  // namespace

Mission read_kml_mission(std::string_view text, const std::string& where) {
  const Element document = read_document(text, where);
  bool is_wpml = false;
  for_each_element(document, [&](const Element& element) {
    is_wpml = is_wpml || element.name == "missionConfig" || element.name == "executeHeightMode" ||
              element.name == "waylineCoordinateSysParam";
  });
  if (is_wpml) return WpmlReader(document, where).take();
  return RouteReader(document, where).take();
}

}  // namespace tileflight::missions
