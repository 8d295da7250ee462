// DJI's subtitle telemetry. The format of an entry depends on the aircraft and its firmware; seen in real logs:
//
//   [latitude: 41.4] [longitude: 2.2] [altitude: 117.0]
//       Air 2, Air 2S; "longtitude" on Mavic 2 Pro
//   [latitude: ..] [longitude: ..] [rel_alt: 38.0 abs_alt: 2933.4] [gb_yaw: 139.7 gb_pitch: -27.8 gb_roll: 0.0]
//       Mini 3, Mavic 3, M30
//   GPS(-1.2218,42.4668,17) BAROMETER:20.1
//       Mavic Pro: longitude, latitude, number of satellites
//   GPS (8.2090, 47.4692, 18), D 49.21m, H 45.60m
//       Phantom 4 Pro, Mavic Mini: the same order, H is above take-off
//   GPS (..), HOME (..), H 17.39m, F.PRY (-5.3°, 2.1°, 28.3°), G.PRY (-27.3°, 0.0°, -76.0°)
//       Phantom 4 RTK: the vehicle's and the gimbal's pitch, roll, yaw; RTK (..) in place of GPS (..) with corrections
//   [latitude: ..] [longtitude: ..] [altitude: 28.7] [Drone: Yaw:-146.0, Pitch:-0.6, Roll:1.3]
//       Mavic 2 Enterprise: the vehicle's attitude; [Gimbal: Yaw:.., Pitch:.., Roll:..] beside it
//   GPS(36.6146,-6.1120,0.0M) BAROMETER:0.3M
//       Matrice 300: latitude, longitude, height with its unit
//   GPS(E:149.0227, N:-35.2858, 0.46m)
//       Autel: the axes by their letters
//
// The third number of the Mavic Pro is the satellite count, as its entries without a fix show: GPS(N/A,N/A,3). A third
// number with a unit or a fraction is a height, and those firmwares write the latitude first. One file may hold several
// dialects (joined recordings).
#include <algorithm>
#include <array>
#include <numbers>
#include <span>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {
namespace {

/// The lines of one subtitle: number, time stamps, payload.
struct Entry {
  std::string_view number;
  std::vector<std::string_view> lines;
};

/// A line of digits alone starts a subtitle; text before the first one is ignored.
std::vector<Entry> split_entries(std::string_view text) {
  std::vector<Entry> entries;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = base::trim(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    if (!line.empty() && std::all_of(line.begin(), line.end(), base::is_digit)) {
      entries.push_back({line, {}});
    } else if (!line.empty() && !entries.empty()) {
      entries.back().lines.push_back(line);
    }
  }
  return entries;
}

/// Start of `HH:MM:SS,mmm --> HH:MM:SS,mmm`.
std::optional<double> stamp_s(std::string_view line) {
  const std::optional<double> start = base::take_clock(line);
  return start && base::trim(line).starts_with("-->") ? start : std::nullopt;
}

/// `2017.08.05 14:11:51,393` as Unix time, for the dialect without stamps.
std::optional<double> date_s(std::string_view line) {
  const std::optional<double> day = base::take_day(line);
  line = base::trim(line);
  const std::optional<double> clock = base::take_clock(line);
  if (!day || !clock) return std::nullopt;
  return 86400.0 * *day + *clock;
}

/// The text after `key` if it occurs as a word of its own; nullopt otherwise.
std::optional<std::string_view> after_key(std::string_view line, std::string_view key) {
  const auto is_word = [](char c) {
    return base::is_digit(c) || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_' || c == '.';
  };
  for (std::size_t at = line.find(key); at != std::string_view::npos; at = line.find(key, at + 1)) {
    const std::size_t end = at + key.size();
    if (at > 0 && is_word(line[at - 1])) continue;
    if (end < line.size() && is_word(line[end])) continue;
    return line.substr(end);
  }
  return std::nullopt;
}

/// The text of the value in `key: 1.5`, `key 1.5m`, `key(1.5)`, up to the next blank or bracket; empty if there is
/// none.
std::string_view text_of(std::string_view line, std::string_view key) {
  const std::optional<std::string_view> rest = after_key(line, key);
  if (!rest) return {};
  std::string_view text = base::trim(*rest);
  if (!base::take_prefix(text, ":")) base::take_prefix(text, "(");
  text = base::trim(text);
  text = text.substr(0, text.find_first_of(" \t])"));
  while (text.ends_with(',') || text.ends_with(';')) text.remove_suffix(1);
  return text;
}

[[noreturn]] void refuse(std::string_view key, std::string_view text) {
  throw InputError(std::string(key),
                   "'" + std::string(text.substr(0, 60)) + "' is no number; correct the log, or export it anew");
}

/// A unit as it stands behind a number, lower case, and its size in metres or degrees.
struct MarkedUnit {
  std::string_view name;
  double size;
};
constexpr double kFoot_m = 0.3048, kRadian_deg = 180.0 / std::numbers::pi;
constexpr std::array<MarkedUnit, 6> kMarkedHeights{
    {{"m", 1}, {"ft", kFoot_m}, {"feet", kFoot_m}, {"foot", kFoot_m}, {"'", kFoot_m}, {"meters", 1}}};
constexpr std::array<MarkedUnit, 4> kMarkedAngles{
    {{"\xC2\xB0", 1}, {"deg", 1}, {"rad", kRadian_deg}, {"rads", kRadian_deg}}};

/// The size of a unit; nullopt: not one of these.
std::optional<double> size_of(std::span<const MarkedUnit> units, std::string_view name) {
  const auto found = std::ranges::find(units, base::to_lower(name), &MarkedUnit::name);
  return found == units.end() ? std::nullopt : std::optional(found->size);
}

/// Takes the number at the front of a value, with a point or a comma, and leaves what stands behind it.
std::optional<double> take_value(std::string_view& text) {
  const std::size_t end = std::min(text.find_first_not_of("+-0123456789.,eE"), text.size());
  std::string_view number = text.substr(0, end);
  while (number.ends_with(',')) number.remove_suffix(1);
  const std::optional<double> value = base::parse_decimal_number(number);
  if (value) text.remove_prefix(number.size());
  return value;
}

/// The number in `key: 1.5`, `key 1.5m`, `key: 1,5`, `key: 4.9 ft`, in metres or degrees; nullopt where the key is
/// missing or the value is no number at all ("N/A"). Throws InputError for a number that goes on otherwise ("1.5.2").
std::optional<double> value_of(std::string_view line, std::string_view key, std::span<const MarkedUnit> units) {
  const std::string_view whole = text_of(line, key);
  std::string_view number = whole, unit = whole;
  if (!base::take_number(number)) return std::nullopt;
  const std::optional<double> value = take_value(unit);
  if (!value) refuse(key, whole);
  if (unit.empty()) {  // it may be the next word
    std::string_view next = base::trim(line.substr(static_cast<std::size_t>(whole.end() - line.begin())));
    next = next.substr(0, next.find_first_of(" \t],;)"));
    return *value * size_of(units, next).value_or(1.0);
  }
  const std::optional<double> size = size_of(units, unit);
  if (!size) refuse(key, whole);
  return *value * *size;
}

/// The angle in `key: 47.5`, `key: 47,5`, `key: 47.5 N`, `key: 47° 30' 0" N`, in degrees. Throws as value_of().
std::optional<double> angle_of(std::string_view line, std::string_view key) {
  const std::optional<std::string_view> rest = after_key(line, key);
  if (!rest) return std::nullopt;
  std::string_view text = base::trim(*rest);
  base::take_prefix(text, ":");
  text = base::trim(text.substr(0, text.find_first_of("])")));
  std::string_view number = text;
  if (!base::take_number(number)) return std::nullopt;
  if (const std::optional<double> angle = base::parse_angle_deg(text)) return angle;
  // Other keys follow: the number, and a letter for its hemisphere.
  const std::string_view alone = text_of(line, key);
  std::string_view behind = base::trim(text.substr(alone.size()));
  const std::string_view letter = behind.substr(0, behind.find(' '));
  const bool has_letter = letter.size() == 1 && std::string_view("NSEW").find(letter) != std::string_view::npos;
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  if (behind.empty() || is_letter(behind.front())) {
    if (const auto angle = base::parse_angle_deg(std::string(alone) + (has_letter ? std::string(letter) : "")))
      return angle;
  }
  refuse(key, text);
}

/// A number with the text directly after it up to the comma or bracket ("0.0M").
struct Item {
  std::optional<double> value;  ///< nullopt for "N/A"
  bool is_height = false;       ///< has a unit or a fraction
  char axis = '\0';             ///< the letter in front: "E:149.02", "N:-35.28"
};

Item parse_item(std::string_view key, std::string_view text) {
  Item item;
  text = base::trim(text);
  if (text.size() > 2 && text[1] == ':') {
    item.axis = text[0];
    text = base::trim(text.substr(2));
  }
  std::string_view number = text;
  if (!base::take_number(number)) return item;
  item.is_height = text.find('.') != std::string_view::npos || !base::trim(number).empty();
  const std::string_view whole = text;
  item.value = take_value(text);
  text = base::trim(text);
  auto size = text.empty() ? std::optional(1.0) : size_of(kMarkedHeights, text);
  if (!size) size = size_of(kMarkedAngles, text);
  if (!item.value || !size) refuse(key, whole);
  *item.value *= *size;
  return item;
}

/// The comma-separated items of `key (a, b, c)`; empty if the key is missing. Commas inside numbers are told from those
/// between them by the blanks after the latter. Throws InputError where that is not certain.
std::vector<Item> tuple_of(std::string_view line, std::string_view key) {
  const std::optional<std::string_view> rest = after_key(line, key);
  if (!rest) return {};
  std::string_view text = base::trim(*rest);
  if (!base::take_prefix(text, "(")) return {};
  text = text.substr(0, text.find(')'));
  const auto split = [&](std::string_view separator) {
    std::vector<std::string_view> parts;
    for (std::string_view left = text; parts.size() < 8;) {
      const std::size_t end = left.find(separator);
      parts.push_back(left.substr(0, end));
      if (end == std::string_view::npos) break;
      left.remove_prefix(end + separator.size());
    }
    return parts;
  };
  std::vector<std::string_view> parts = split(",");
  constexpr std::size_t kUsual = 3;
  if (parts.size() > kUsual && text.find('.') == std::string_view::npos) {
    parts = split(", ");
    if (parts.size() != kUsual) {
      throw InputError(std::string(key), "'(" + std::string(text.substr(0, 60)) +
                                             ")' has decimal commas that cannot be told from those between numbers");
    }
  }
  std::vector<Item> items;
  for (const std::string_view part : parts) items.push_back(parse_item(key, part));
  return items;
}

/// An entry as written; it has a position if both numbers are present.
struct Reading {
  std::optional<double> stamp_s, date_s;
  TelemetryFix fix;
  ZoomReading zoom;
  bool has_position = false;
};

void fill(std::optional<double>& field, const std::optional<double>& value) {
  if (!field) field = value;
}

void read_bracketed_position(std::string_view line, Reading& reading) {
  const std::optional<double> latitude = angle_of(line, "latitude");
  std::optional<double> longitude = angle_of(line, "longitude");
  fill(longitude, angle_of(line, "longtitude"));  // spelling of Mavic 2 firmware
  if (!latitude || !longitude) return;
  reading.fix.latitude_deg = *latitude;
  reading.fix.longitude_deg = *longitude;
  reading.has_position = true;
}

void read_gps_tuple(std::string_view line, std::string_view key, Reading& reading) {
  const std::vector<Item> items = tuple_of(line, key);
  if (items.size() < 2 || !items[0].value || !items[1].value) return;
  const bool latitude_first =
      items[0].axis != '\0' ? items[0].axis == 'N' || items[0].axis == 'S' : items.size() > 2 && items[2].is_height;
  if (items.size() > 2 && items[2].is_height) reading.fix.absolute_height_m = items[2].value;
  reading.fix.latitude_deg = *items[latitude_first ? 0 : 1].value;
  reading.fix.longitude_deg = *items[latitude_first ? 1 : 0].value;
  for (std::size_t i = 0; i < 2; ++i) {
    if (items[i].axis == 'S') reading.fix.latitude_deg = -reading.fix.latitude_deg;
    if (items[i].axis == 'W') reading.fix.longitude_deg = -reading.fix.longitude_deg;
  }
  reading.has_position = true;
}

void read_heights(std::string_view line, Reading& reading) {
  fill(reading.fix.absolute_height_m, value_of(line, "abs_alt", kMarkedHeights));
  fill(reading.fix.absolute_height_m, value_of(line, "altitude", kMarkedHeights));
  fill(reading.fix.height_above_takeoff_m, value_of(line, "rel_alt", kMarkedHeights));
  fill(reading.fix.height_above_takeoff_m, value_of(line, "BAROMETER", kMarkedHeights));
  fill(reading.fix.height_above_takeoff_m, value_of(line, "H", kMarkedHeights));
}

/// The fields of a fix that hold one attitude.
struct AttitudeFields {
  std::optional<double>& yaw_deg;
  std::optional<double>& pitch_deg;
  std::optional<double>& roll_deg;
};

/// Reads `F.PRY (pitch, roll, yaw)`.
void read_pitch_roll_yaw(std::string_view line, std::string_view key, const AttitudeFields& attitude) {
  const std::vector<Item> items = tuple_of(line, key);
  if (items.size() != 3) return;
  fill(attitude.pitch_deg, items[0].value);
  fill(attitude.roll_deg, items[1].value);
  fill(attitude.yaw_deg, items[2].value);
}

/// Reads `[Drone: Yaw:-146.0, Pitch:-0.6, Roll:1.3]`.
void read_attitude_group(std::string_view line, std::string_view key, const AttitudeFields& attitude) {
  const std::optional<std::string_view> rest = after_key(line, key);
  if (!rest || !rest->starts_with(":")) return;
  std::string_view group = rest->substr(1);
  group = group.substr(0, group.find(']'));
  while (!group.empty()) {
    const std::size_t end = std::min(group.find(','), group.size());
    const std::string_view part = group.substr(0, end);
    fill(attitude.yaw_deg, value_of(part, "Yaw", kMarkedAngles));
    fill(attitude.pitch_deg, value_of(part, "Pitch", kMarkedAngles));
    fill(attitude.roll_deg, value_of(part, "Roll", kMarkedAngles));
    group.remove_prefix(std::min(end + 1, group.size()));
  }
}

void read_attitudes(std::string_view line, TelemetryFix& fix) {
  const AttitudeFields gimbal{fix.gimbal_yaw_deg, fix.gimbal_pitch_deg, fix.gimbal_roll_deg};
  const AttitudeFields body{fix.body_yaw_deg, fix.body_pitch_deg, fix.body_roll_deg};
  for (const std::string_view prefix : {"gb_", "gimbal_"}) {
    const std::string start(prefix);
    fill(gimbal.yaw_deg, value_of(line, start + "yaw", kMarkedAngles));
    fill(gimbal.pitch_deg, value_of(line, start + "pitch", kMarkedAngles));
    fill(gimbal.roll_deg, value_of(line, start + "roll", kMarkedAngles));
  }
  read_pitch_roll_yaw(line, "G.PRY", gimbal);
  read_pitch_roll_yaw(line, "F.PRY", body);
  read_attitude_group(line, "Gimbal", gimbal);
  read_attitude_group(line, "Drone", body);
}

/// Reads `[focal_len : 240] [dzoom_ratio: 10000, delta:0]` (tenths of a millimetre, ten-thousandths) and
/// `[focal_len: 24.00] [dzoom_ratio: 1.00]`. What is no number there does not matter for positions.
void read_zoom(std::string_view line, ZoomReading& zoom) {
  constexpr double kLargestZoom = 1000.0, kTenThousandths = 1e-4;
  const auto number_of = [&](std::string_view key) {
    std::string_view text = text_of(line, key);
    while (!text.empty() && std::string_view("xXmM").find(text.back()) != std::string_view::npos) text.remove_suffix(1);
    return base::parse_decimal_number(text);
  };
  fill(zoom.focal_length, number_of("focal_len"));
  for (const std::string_view key : {"dzoom_ratio", "dzoom", "digital_zoom", "zoom_ratio"})
    fill(zoom.digital_zoom, number_of(key));
  if (zoom.digital_zoom && *zoom.digital_zoom > kLargestZoom) *zoom.digital_zoom *= kTenThousandths;
}

Reading read_entry(const Entry& entry) {
  Reading reading;
  for (const std::string_view line : entry.lines) {
    fill(reading.stamp_s, stamp_s(line));
    fill(reading.date_s, date_s(line));
    if (!reading.has_position) read_bracketed_position(line, reading);
    for (const std::string_view key : {"GPS", "RTK"})
      if (!reading.has_position) read_gps_tuple(line, key, reading);
    read_heights(line, reading);
    read_attitudes(line, reading.fix);
    read_zoom(line, reading.zoom);
  }
  return reading;
}

Telemetry collect(const std::vector<Reading>& readings) {
  const bool by_stamp =
      std::any_of(readings.begin(), readings.end(), [](const Reading& r) { return r.stamp_s.has_value(); });
  FixFilter filter;
  std::vector<ZoomReading> zooms;
  std::optional<double> first_date_s;
  for (const Reading& reading : readings) {
    fill(first_date_s, reading.date_s);
    std::optional<double> time_s = reading.stamp_s;
    if (!by_stamp && reading.date_s) time_s = *reading.date_s - *first_date_s;
    if (time_s && (reading.zoom.focal_length || reading.zoom.digital_zoom)) {
      zooms.push_back(reading.zoom);
      zooms.back().time_s = *time_s;
      zooms.back().where = base::formatted("%.2f s", *time_s);
    }
    if (!time_s) {
      filter.drop_without_time();
    } else if (!reading.has_position) {
      filter.drop_without_fix();
    } else {
      TelemetryFix fix = reading.fix;
      fix.time_s = *time_s;
      filter.add(fix);
    }
  }
  Telemetry telemetry = std::move(filter).finish();
  telemetry.zooms = std::move(zooms);
  return telemetry;
}

}  // namespace

Telemetry read_dji_srt(const std::filesystem::path& file) {
  return parse_dji_srt(base::read_text(file, base::kMaxLogBytes), file.string());
}

Telemetry parse_dji_srt(std::string_view text, const std::string& where) {
  const std::vector<Entry> entries = split_entries(base::strip_byte_order_mark(text));
  if (entries.empty()) throw InputError(where, "no subtitle entries; is this a DJI .srt log?");
  std::vector<Reading> readings;
  readings.reserve(entries.size());
  for (const Entry& entry : entries) {
    try {
      readings.push_back(read_entry(entry));
    } catch (const InputError& fault) {
      throw InputError(where + ", entry " + std::string(entry.number.substr(0, 12)), fault.what());
    }
  }
  Telemetry telemetry = collect(readings);
  if (telemetry.fixes.empty()) {
    const std::string cause = telemetry.warnings.empty() ? "" : " (" + telemetry.warnings.front() + ")";
    throw InputError(where, "none of the " + std::to_string(entries.size()) + " entries has a time and a position" +
                                cause + "; switch on captions with position in the camera's settings");
  }
  drop_unrecorded_heights(telemetry);
  return telemetry;
}

}  // namespace tileflight::flight_logs
