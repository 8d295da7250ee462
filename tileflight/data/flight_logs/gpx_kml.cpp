#include <algorithm>
#include <functional>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"
#include "tileflight/data/flight_logs/xml_stream.h"

namespace tileflight::flight_logs {

namespace {

/// The points of a file whose parts (tracks, segments) may stand in any order: programs write the newest first.
class UtcFixes {
 public:
  FixFilter filter;  ///< counts what is no fix

  void add(const TelemetryFix& fix) { part_.push_back(fix); }
  /// Ends a part: later points belong to another one.
  void end_part() {
    if (part_.empty()) return;
    const bool is_reversed = part_.front().time_s > part_.back().time_s &&
                             std::ranges::is_sorted(part_, std::ranges::greater{}, &TelemetryFix::time_s);
    if (is_reversed) std::ranges::reverse(part_);
    was_sorted_ = was_sorted_ || is_reversed;
    parts_.push_back(std::move(part_));
    part_.clear();
  }
  /// Puts the parts in the order of their first times and returns the fixes as FixFilter::finish() does.
  /// `fault`: where the file is damaged, or nothing.
  Telemetry finish(const std::string& where, const std::string& entries, const std::string& fault) && {
    end_part();
    const auto begins_earlier = [](const auto& a, const auto& b) { return a.front().time_s < b.front().time_s; };
    was_sorted_ = was_sorted_ || !std::ranges::is_sorted(parts_, begins_earlier);
    std::ranges::stable_sort(parts_, begins_earlier);
    const std::vector<std::string> damage =
        fault.empty() ? std::vector<std::string>{} : std::vector{"the file is damaged at " + fault};
    for (const std::vector<TelemetryFix>& part : parts_)
      for (const TelemetryFix& fix : part) filter.add(fix);
    Telemetry telemetry = std::move(filter).finish(where, entries, damage);
    if (was_sorted_) telemetry.warnings.emplace_back("the tracks were not in order of time and have been sorted");
    return telemetry;
  }

 private:
  std::vector<std::vector<TelemetryFix>> parts_;
  std::vector<TelemetryFix> part_;
  bool was_sorted_ = false;
};

/// One `gx:Track`: its `when` and `coord` elements correspond by order.
struct Track {
  std::vector<std::optional<double>> times_s;
  std::vector<std::optional<TelemetryFix>> positions;
  bool is_absolute = false;
};

/// `longitude latitude altitude`, degrees and metres; empty for "no position at this time".
std::optional<TelemetryFix> parse_coord(std::string_view text) {
  TelemetryFix fix;
  const std::optional<double> longitude_deg = base::take_number(text);
  const std::optional<double> latitude_deg = base::take_number(text);
  if (!longitude_deg || !latitude_deg) return std::nullopt;
  fix.longitude_deg = *longitude_deg;
  fix.latitude_deg = *latitude_deg;
  if (base::trim(text).empty()) return fix;
  fix.absolute_height_m = base::take_number(text);
  return base::trim(text).empty() ? std::optional(fix) : std::nullopt;
}

class KmlReader {
 public:
  explicit KmlReader(std::string where) : where_(std::move(where)) {}

  bool start(std::string_view name) {
    if (++depth_ == 1 && name != "kml") {
      throw InputError(where_, "is XML but not KML: its root element is <" + std::string(name.substr(0, 40)) + ">");
    }
    if (name == "MultiTrack") multi_track_is_absolute_ = false;
    if (name == "Track" && !track_) track_.emplace().is_absolute = multi_track_is_absolute_;
    if (name == "Placemark") placemark_ = {};
    if (name == "Placemark") multi_track_is_absolute_ = false;
    if (name == "Point") placemark_.is_in_point = true;
    if (name == "LineString") has_lines_ = true;
    return true;
  }

  bool end(std::string_view name, std::string_view text) {
    --depth_;
    if (name == "MultiTrack") multi_track_is_absolute_ = false;
    if (!track_) return end_of_placemark(name, text);
    if (name == "when") track_->times_s.push_back(base::parse_iso_time_s(text));
    if (name == "coord") track_->positions.push_back(parse_coord(base::trim(text)));
    if (name == "altitudeMode") track_->is_absolute = base::trim(text) == "absolute";
    if (name == "Track") finish_track();
    return true;
  }

  bool has_heights_above_ground() const { return above_ground_; }
  /// Whether there are lines, but no point with a time.
  bool has_only_lines() const { return has_lines_ && !has_points_; }
  UtcFixes take() && { return std::move(fixes_); }

 private:
  /// A placemark with a time stamp and a point.
  struct Placemark {
    std::optional<double> time_s;
    std::optional<TelemetryFix> position;
    bool is_in_point = false, is_absolute = false;
  };

  bool end_of_placemark(std::string_view name, std::string_view text) {
    if (name == "when") placemark_.time_s = base::parse_iso_time_s(text);
    // A MultiTrack states one beside its tracks, for those that have none of their own.
    if (name == "altitudeMode") placemark_.is_absolute = multi_track_is_absolute_ = base::trim(text) == "absolute";
    if (name == "coordinates" && placemark_.is_in_point) {
      std::string numbers(base::trim(text));  // "longitude,latitude,altitude"
      std::ranges::replace(numbers, ',', ' ');
      placemark_.position = parse_coord(numbers);
    }
    if (name == "Point") placemark_.is_in_point = false;
    if (name != "Placemark" || !placemark_.time_s || !placemark_.position) return true;
    has_points_ = true;
    placemark_.position->time_s = *placemark_.time_s;
    if (!placemark_.is_absolute) placemark_.position->absolute_height_m.reset();
    above_ground_ = above_ground_ || !placemark_.is_absolute;
    fixes_.add(*placemark_.position);
    return true;
  }

  void finish_track() {
    has_points_ = true;
    for (std::size_t i = 0; i < std::max(track_->times_s.size(), track_->positions.size()); ++i) {
      if (i >= track_->times_s.size() || !track_->times_s[i]) {
        fixes_.filter.drop_without_time();
      } else if (i >= track_->positions.size() || !track_->positions[i]) {
        fixes_.filter.drop_without_fix();
      } else {
        TelemetryFix fix = *track_->positions[i];
        fix.time_s = *track_->times_s[i];
        if (!track_->is_absolute) fix.absolute_height_m.reset();
        fixes_.add(fix);
      }
    }
    fixes_.end_part();
    above_ground_ = above_ground_ || !track_->is_absolute;
    track_.reset();
  }

  std::string where_;
  int depth_ = 0;
  bool multi_track_is_absolute_ = false;
  bool above_ground_ = false, has_lines_ = false, has_points_ = false;
  std::optional<Track> track_;
  Placemark placemark_;
  UtcFixes fixes_;
};

}  // namespace

Telemetry read_kml(const std::filesystem::path& file) {
  KmlReader reader(file.string());
  const std::string bytes = base::read_raw(file, base::kMaxLogBytes);
  const std::string fault =
      read_xml(bytes, file.string(),
               {.start = [&](std::string_view name, const XmlEvents::Attributes&) { return reader.start(name); },
                .end = [&](std::string_view name, std::string_view text) { return reader.end(name, text); }});
  if (reader.has_only_lines())
    throw InputError(
        file.string(),
        "has a LineString, whose positions have no times: export the flight as GPX, as a KML with gx:Track, or "
        "as CSV with time, latitude and longitude");
  const bool above_ground = reader.has_heights_above_ground();
  Telemetry telemetry = std::move(reader).take().finish(
      file.string(), "points of a gx:Track, and no placemark with a TimeStamp and a Point", fault);
  if (!fault.empty()) telemetry.warnings.push_back(early_end_warning(fault));
  if (above_ground) {
    telemetry.warnings.emplace_back(
        "heights of tracks whose altitudeMode is not 'absolute' are above the ground and are not used");
  }
  finish_utc_log(telemetry);
  return telemetry;
}

namespace {

/// The point being read. Only direct children count: extensions may hold elements of the same names.
struct Point {
  int depth = 0;  ///< nesting depth of its element; 0: none is open
  std::optional<double> latitude_deg, longitude_deg, elevation_m, time_s;
};

std::optional<double> number_attribute(const XmlEvents::Attributes& attributes, std::string_view name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? std::nullopt : base::parse_decimal_number(found->second);
}

class GpxReader {
 public:
  explicit GpxReader(std::string where) : where_(std::move(where)) {}

  bool start(std::string_view name, const XmlEvents::Attributes& attributes) {
    if (++depth_ == 1 && name != "gpx") {
      throw InputError(where_, "is XML but not GPX: its root element is <" + std::string(name.substr(0, 40)) + ">");
    }
    if (name == "trkpt" && point_.depth == 0) {
      point_ = {.depth = depth_,
                .latitude_deg = number_attribute(attributes, "lat"),
                .longitude_deg = number_attribute(attributes, "lon"),
                .elevation_m = {},
                .time_s = {}};
    }
    return true;
  }

  bool end(std::string_view name, std::string_view text) {
    if (point_.depth > 0 && depth_ == point_.depth + 1) {
      if (name == "ele") point_.elevation_m = base::parse_decimal_number(text);
      if (name == "time") point_.time_s = base::parse_iso_time_s(text);
    }
    if (point_.depth > 0 && depth_ == point_.depth) finish_point();
    if (name == "trkseg" || name == "trk") fixes_.end_part();
    --depth_;
    return true;
  }

  UtcFixes take() && { return std::move(fixes_); }

 private:
  void finish_point() {
    if (!point_.time_s) {
      fixes_.filter.drop_without_time();
    } else if (!point_.latitude_deg || !point_.longitude_deg) {
      fixes_.filter.drop_without_fix();
    } else {
      TelemetryFix fix;
      fix.time_s = *point_.time_s;
      fix.latitude_deg = *point_.latitude_deg;
      fix.longitude_deg = *point_.longitude_deg;
      fix.absolute_height_m = point_.elevation_m;
      fixes_.add(fix);
    }
    point_ = {};
  }

  std::string where_;
  int depth_ = 0;
  Point point_;
  UtcFixes fixes_;
};

}  // namespace

Telemetry read_gpx(const std::filesystem::path& file) {
  GpxReader reader(file.string());
  const std::string bytes = base::read_raw(file, base::kMaxLogBytes);
  const std::string fault =
      read_xml(bytes, file.string(),
               {.start = [&](std::string_view name, const auto& attributes) { return reader.start(name, attributes); },
                .end = [&](std::string_view name, std::string_view text) { return reader.end(name, text); }});
  Telemetry telemetry = std::move(reader).take().finish(file.string(), "track points", fault);
  if (!fault.empty()) telemetry.warnings.push_back(early_end_warning(fault));
  finish_utc_log(telemetry);
  return telemetry;
}

}  // namespace tileflight::flight_logs
