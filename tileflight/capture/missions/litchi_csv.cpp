// Litchi's table of waypoints (litchiutilities.com, "Litchi CSV Format"): metres, or feet in the columns that say so.
#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "tileflight/capture/missions/mission.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/inertial_logs.h"

namespace tileflight::missions {
namespace {

using flight_logs::split_at_commas;

constexpr double kFoot_m = 0.3048;
constexpr int kFocusTarget = 1, kInterpolate = 2;                  // gimbalmode
constexpr int kStayFor = 0, kRotateAircraft = 4, kTiltCamera = 5;  // actiontype; -1: none
constexpr int kActions = 15;

/// The table's columns by their names, with the length of their unit.
class Columns {
 public:
  Columns(std::string_view header, const std::string& where) {
    const std::vector<std::string_view> names = split_at_commas(header);
    for (std::size_t i = 0; i < names.size(); ++i) add(base::to_lower(names[i]), i, where);
    for (const char* needed : {"latitude", "longitude", "altitude"})
      if (!column_of_.contains(needed))
        throw InputError(where, std::string("has no column '") + needed + "'; export the mission as CSV again");
  }

  std::size_t count() const { return column_of_.size(); }

  /// The value in metres, seconds or degrees; nullopt where the column is missing or the field empty. Throws
  /// InputError for a field that is no number.
  std::optional<double> value(const std::vector<std::string_view>& fields, const std::string& name,
                              const std::string& where) const {
    const auto found = column_of_.find(name);
    if (found == column_of_.end() || found->second.index >= fields.size()) return std::nullopt;
    const std::string_view field = fields[found->second.index];
    if (field.empty()) return std::nullopt;
    const auto number = base::parse_finite_number(field);
    if (!number) throw InputError(where, name + " '" + std::string(field.substr(0, 40)) + "' is no number");
    return *number * found->second.unit;
  }

 private:
  struct Column {
    std::size_t index = 0;
    double unit = 1.0;
  };

  void add(const std::string& name, std::size_t index, const std::string& where) {
    const std::size_t bracket = name.find('(');
    const std::string unit = bracket == std::string::npos ? "" : name.substr(bracket);
    const bool is_known = unit.empty() || unit == "(m)" || unit == "(ft)" || unit == "(deg)" || unit == "(m/s)";
    if (!is_known)
      throw InputError(
          where, "the unit of column '" + name.substr(0, 60) + "' is unknown; (m), (ft), (deg) and (m/s) are read");
    if (!column_of_.emplace(name.substr(0, bracket), Column{index, unit == "(ft)" ? kFoot_m : 1.0}).second)
      throw InputError(where, "has the column '" + name.substr(0, 60) + "' twice");
  }

  std::map<std::string, Column> column_of_;
};

class LitchiReader {
 public:
  LitchiReader(const Columns& columns, Mission& mission) : columns_(columns), mission_(mission) {}

  void add(std::string_view line, const std::string& where) {
    fields_ = split_at_commas(line);
    where_ = where;
    if (fields_.size() < columns_.count())
      throw InputError(where, "has " + std::to_string(fields_.size()) + " fields instead of " +
                                  std::to_string(columns_.count()) + "; is it cut off?");
    MissionWaypoint waypoint;
    waypoint.position = position();
    const double curve_m = value("curvesize").value_or(0.0);
    waypoint.passing = {Passing::Kind::kRounded, curve_m > 0.0 ? curve_m : Passing{}.distance_m, 0.0};
    const double speed_m_s = value("speed").value_or(0.0);
    if (speed_m_s > 0.0) waypoint.speed_m_s = speed_m_s;
    waypoint.heading = {Heading::Kind::kBlend, value("heading").value_or(0.0)};
    has_headings_ = has_headings_ || waypoint.heading.deg != 0.0;
    set_view(waypoint);
    for (int i = 1; i <= kActions; ++i) act(std::to_string(i), waypoint);
    mission_.waypoints.push_back(waypoint);
  }

  void finish() {
    mission_.notes.emplace_back(
        "Litchi's CSV does not hold the mission's heading mode and path mode: headings are those of its rows, and "
        "corners are rounded by curvesize");
    if (!has_headings_) {
      mission_.notes.back() =
          "the CSV has no headings: the camera looks in the direction of flight where it has no target";
      for (MissionWaypoint& waypoint : mission_.waypoints)
        if (waypoint.heading.kind == Heading::Kind::kBlend) waypoint.heading = {};
    }
    if (photos_ > 0)
      mission_.notes.push_back("images are taken at the flight's fps; " + std::to_string(photos_) +
                               " actions of the camera are not simulated");
  }

 private:
  std::optional<double> value(const std::string& name) const { return columns_.value(fields_, name, where_); }

  static HeightAbove above(std::optional<double> mode) {
    return mode.value_or(0.0) == 1.0 ? HeightAbove::kGround : HeightAbove::kTakeoff;
  }

  MissionPosition position() const {
    const auto latitude = value("latitude"), longitude = value("longitude"), height = value("altitude");
    if (!latitude || !longitude || !height) throw InputError(where_, "lacks its latitude, longitude or altitude");
    require_on_earth(*latitude, *longitude, where_);
    return {*latitude, *longitude, height, above(value("altitudemode"))};
  }

  void set_view(MissionWaypoint& waypoint) {
    const int mode = static_cast<int>(std::clamp(value("gimbalmode").value_or(0.0), -1.0, 9.0));
    if (mode == kInterpolate) pitch_deg_ = std::clamp(value("gimbalpitchangle").value_or(0.0), -90.0, 90.0);
    if (pitch_deg_) waypoint.pitch = {mode == kInterpolate ? Pitch::Kind::kBlend : Pitch::Kind::kFixed, *pitch_deg_};
    const double latitude = value("poi_latitude").value_or(0.0), longitude = value("poi_longitude").value_or(0.0);
    if (mode != kFocusTarget || (latitude == 0.0 && longitude == 0.0)) return;
    require_on_earth(latitude, longitude, where_ + ", poi");
    waypoint.target =
        MissionPosition{latitude, longitude, value("poi_altitude").value_or(0.0), above(value("poi_altitudemode"))};
    waypoint.heading = {Heading::Kind::kTarget, waypoint.heading.deg};
    waypoint.pitch = {Pitch::Kind::kTarget, pitch_deg_.value_or(0.0)};
  }

  void act(const std::string& number, MissionWaypoint& waypoint) {
    constexpr double kLongest_s = 3600.0, kMillisecond_s = 1e-3;
    const double type = value("actiontype" + number).value_or(-1.0);
    const double parameter = value("actionparam" + number).value_or(0.0);
    if (type == kStayFor) {
      waypoint.passing.kind = Passing::Kind::kStop;
      waypoint.passing.hold_s += std::clamp(parameter * kMillisecond_s, 0.0, kLongest_s);
    } else if (type == kRotateAircraft) {
      waypoint.passing.kind = Passing::Kind::kStop;
      waypoint.heading = {Heading::Kind::kBlend, parameter};
      has_headings_ = true;
    } else if (type == kTiltCamera) {
      pitch_deg_ = std::clamp(parameter, -90.0, 90.0);
      if (waypoint.pitch.kind != Pitch::Kind::kTarget) waypoint.pitch = {Pitch::Kind::kFixed, *pitch_deg_};
    } else if (type >= 0.0) {
      ++photos_;
    }
  }

  const Columns& columns_;
  Mission& mission_;
  std::vector<std::string_view> fields_;
  std::string where_;
  std::optional<double> pitch_deg_;
  bool has_headings_ = false;
  int photos_ = 0;
};

}  // namespace

Mission read_litchi(std::string_view text, const std::string& where) {
  text = base::strip_byte_order_mark(text);
  int line_number = 1;
  const auto header = base::take_line(text);
  if (!header) throw InputError(where, "is empty");
  const Columns columns(*header, where);
  Mission mission;
  mission.format = "a mission of Litchi (CSV)";
  LitchiReader reader(columns, mission);
  while (const auto line = base::take_line(text)) {
    ++line_number;
    if (!base::trim(*line).empty()) reader.add(*line, where + ":" + std::to_string(line_number));
  }
  reader.finish();
  return mission;
}

}  // namespace tileflight::missions
