#include "tileflight/data/flight_logs/telemetry.h"

#include <algorithm>
#include <string>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/dataflash_messages.h"
#include "tileflight/data/flight_logs/photo_log.h"
#include "tileflight/data/flight_logs/xml_stream.h"

namespace tileflight::flight_logs {
namespace {

enum class Format { kDjiSubtitles, kGpx, kKml, kCsv, kUlog, kDataflash, kNmea, kMavlink };

/// Name of the root element if the text starts with XML; otherwise empty.
std::string root_of(std::string_view head) {
  std::string root;
  const auto name_and_stop = [&](std::string_view name, const XmlEvents::Attributes&) {
    root = name;
    return false;
  };
  try {
    read_xml(head, "", {.start = name_and_stop, .end = [](std::string_view, std::string_view) { return false; }});
  } catch (const InputError&) {  // a document type: the reader reports it with the file's name
  }
  return root;
}

/// The first line that is not blank is a subtitle number, which no table header is.
bool is_subtitles(std::string_view head) {
  head = base::trim(base::strip_byte_order_mark(head));
  const std::string_view line = base::trim(head.substr(0, head.find('\n')));
  return !line.empty() && std::all_of(line.begin(), line.end(), base::is_digit);
}

bool has_subtitles_name(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".srt" || extension == ".SRT";
}

/// UTF-8 that starts with a tag, or UTF-16 that is XML.
bool is_xml(std::string_view head) {
  if (base::trim(base::strip_byte_order_mark(head)).starts_with('<')) return true;
  return (head.starts_with("\xFF\xFE") || head.starts_with("\xFE\xFF")) && !root_of(head).empty();
}

/// `rostopic echo` and `ros2 topic echo` print a message's header first.
bool is_ros_message(std::string_view head) {
  std::string_view text = base::trim(base::strip_byte_order_mark(head));
  if (text.starts_with("---")) text = base::trim(text.substr(3));
  return text.starts_with("header:");
}

Format format_of(const std::filesystem::path& file) {
  const std::string head = base::read_head(file);
  if (head.starts_with("ULog")) return Format::kUlog;
  if (is_dataflash(head)) return Format::kDataflash;
  if (is_mavlink_log(head)) return Format::kMavlink;
  if (is_xml(head)) return root_of(head) == "kml" ? Format::kKml : Format::kGpx;
  if (is_nmea(head)) return Format::kNmea;
  if (is_subtitles(head) || has_subtitles_name(file)) return Format::kDjiSubtitles;
  if (const auto refusal = base::refusal_of_kind(head, "a flight log")) throw InputError(file.string(), *refusal);
  if (const std::string_view text = base::trim(base::strip_byte_order_mark(head));
      text.starts_with('{') || text.starts_with('['))
    throw InputError(
        file.string(),
        "is JSON, which is not read as a flight log: write it as CSV with time, latitude, longitude and a height");
  if (is_ros_message(head))
    throw InputError(file.string(),
                     "is a ROS message as text: write the topic as a table, rostopic echo -p TOPIC > FILE.csv");
  return Format::kCsv;
}

Telemetry read_photos(const std::filesystem::path& folder) {
  PhotoLog log = read_photo_log(folder);
  if (log.telemetry.fixes.empty()) {
    throw InputError(folder.string(), "none of its " + std::to_string(log.photos) +
                                          " JPEG photos has a time and a position in its metadata");
  }
  return std::move(log.telemetry);
}

}  // namespace

Telemetry read_telemetry(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) return read_photos(file);
  switch (format_of(file)) {
    case Format::kGpx:
      return read_gpx(file);
    case Format::kKml:
      return read_kml(file);
    case Format::kCsv:
      return read_csv_log(file);
    case Format::kUlog:
      return read_ulog(file);
    case Format::kDataflash:
      return read_dataflash(file);
    case Format::kNmea:
      return read_nmea(file);
    case Format::kMavlink:
      return read_mavlink_log(file);
    case Format::kDjiSubtitles:
      break;
  }
  return read_dji_srt(file);
}

std::vector<RangeReading> read_ranges(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file) || format_of(file) != Format::kDataflash) return {};
  return read_dataflash_ranges(file);
}

std::vector<TelemetryFix> distinct_fixes(const Telemetry& telemetry) {
  const auto is_held = [](const TelemetryFix& a, const TelemetryFix& b) {
    return a.latitude_deg == b.latitude_deg && a.longitude_deg == b.longitude_deg &&
           a.absolute_height_m == b.absolute_height_m && a.height_above_takeoff_m == b.height_above_takeoff_m;
  };
  std::vector<TelemetryFix> fixes;
  std::unique_copy(telemetry.fixes.begin(), telemetry.fixes.end(), std::back_inserter(fixes), is_held);
  return fixes;
}

}  // namespace tileflight::flight_logs
