#include "tileflight/flight/telemetry_file.h"

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

#include "tileflight/flight/csv_log.h"
#include "tileflight/flight/dataflash_log.h"
#include "tileflight/flight/dataflash_messages.h"
#include "tileflight/flight/gpx.h"
#include "tileflight/flight/kml.h"
#include "tileflight/flight/log_text.h"
#include "tileflight/flight/photo_log.h"
#include "tileflight/flight/ulog.h"
#include "tileflight/flight/xml_stream.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::flight {
namespace {

enum class Format { kDjiSubtitles, kGpx, kKml, kCsv, kUlog, kDataflash };

std::string first_bytes(const std::filesystem::path& file) {
  std::array<char, 4096> bytes{};
  std::ifstream in(file, std::ios::binary);
  in.read(bytes.data(), bytes.size());
  return {bytes.data(), static_cast<std::size_t>(in.gcount())};
}

/// UTF-8 that begins with a tag, or UTF-16 (which only the XML among the formats is written in).
bool is_xml(std::string_view head) {
  return trimmed(without_byte_order_mark(head)).starts_with('<') || head.starts_with("\xFF\xFE") ||
         head.starts_with("\xFE\xFF");
}

/// Name of the root of XML of which this is the beginning; empty where it does not begin with one.
std::string root_of(std::string_view head) {
  std::string root;
  const auto name_and_stop = [&](std::string_view name, const XmlEvents::Attributes&) {
    root = name;
    return false;
  };
  try {
    read_xml(head, "", {.start = name_and_stop, .end = [](std::string_view, std::string_view) { return false; }});
  } catch (const InputError&) {  // a document type: its reader says so with the file's name
  }
  return root;
}

/// The first line with anything in it is the number of a subtitle, which no table's header is.
bool is_subtitles(std::string_view head) {
  head = trimmed(without_byte_order_mark(head));
  const std::string_view line = trimmed(head.substr(0, head.find('\n')));
  return !line.empty() && std::all_of(line.begin(), line.end(), is_digit);
}

bool has_subtitles_name(const std::filesystem::path& file) {
  const std::string extension = file.extension().string();
  return extension == ".srt" || extension == ".SRT";
}

Format format_of(const std::filesystem::path& file) {
  const std::string head = first_bytes(file);
  if (head.starts_with("ULog")) return Format::kUlog;
  if (is_dataflash(head)) return Format::kDataflash;
  if (is_xml(head)) return root_of(head) == "kml" ? Format::kKml : Format::kGpx;
  return is_subtitles(head) || has_subtitles_name(file) ? Format::kDjiSubtitles : Format::kCsv;
}

Telemetry read_photos(const std::filesystem::path& folder) {
  PhotoLog log = read_photo_log(folder);
  if (log.telemetry.fixes.empty()) {
    throw InputError(folder.string(),
                     "none of its " + std::to_string(log.photos) + " JPEG photos says when and where it was taken");
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
    case Format::kDjiSubtitles:
      break;
  }
  return read_dji_srt(file);
}

std::vector<RangeReading> read_ranges(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file) || format_of(file) != Format::kDataflash) return {};
  return read_dataflash_ranges(file);
}

}  // namespace tileflight::flight
