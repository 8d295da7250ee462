#include "tileflight/capture/missions/mission.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/tiles/fetch/zip_archive.h"

namespace tileflight::missions {
namespace {

/// Larger files are refused: a mission of 10 000 waypoints is about 20 MB of WPML.
constexpr std::uintmax_t kMostBytes = std::uintmax_t{64} << 20;
/// A mission of more waypoints is refused: autopilots take some thousand.
constexpr std::size_t kMostWaypoints = 20000;

enum class Format { kPlan, kWaypointList, kLitchi, kKml, kZip };

std::optional<Format> format_of(std::string_view head) {
  if (head.starts_with("PK\3\4")) return Format::kZip;
  const std::string_view text = base::trim(base::strip_byte_order_mark(head));
  if (text.starts_with('{') && text.find("\"fileType\"") != std::string_view::npos) return Format::kPlan;
  if (text.starts_with('{') && text.find("\"geoFence\"") != std::string_view::npos) return Format::kPlan;
  if (text.starts_with("QGC WPL")) return Format::kWaypointList;
  if (text.starts_with('<')) return Format::kKml;
  if (base::to_lower(text.substr(0, 64)).starts_with("latitude,longitude,altitude(")) return Format::kLitchi;
  return std::nullopt;
}

bool ends_in(const std::string& path, std::string_view ending) { return base::to_lower(path).ends_with(ending); }

/// The document of a KMZ: what DJI's vehicles execute, else the template it was made from, else that of any KMZ.
std::string document_in(const std::vector<std::string>& paths, const std::string& where) {
  for (const std::string_view ending : {"waylines.wpml", "template.kml", "doc.kml", ".kml"}) {
    const auto found = std::ranges::find_if(paths, [&](const std::string& path) { return ends_in(path, ending); });
    if (found != paths.end()) return *found;
  }
  throw InputError(where, "is a ZIP archive without waylines.wpml, template.kml or another .kml: it is no mission");
}

Mission read_kmz(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = base::read_bytes(file, kMostBytes);
  const fetch::ZipLimits limits{.max_entries = 1 << 14, .max_directory_bytes = 1 << 23, .max_file_bytes = kMostBytes};
  const auto read_at = [&bytes](std::uint64_t offset, std::size_t length) {
    const auto first = bytes.begin() + static_cast<std::ptrdiff_t>(offset);
    return std::vector<std::byte>(first, first + static_cast<std::ptrdiff_t>(length));
  };
  const fetch::ZipArchive archive(read_at, bytes.size(), file.string(), limits);
  const std::string path = document_in(archive.paths(), file.string());
  const std::vector<std::byte> document = archive.read(path);
  return read_kml_mission(base::as_text(document), file.string() + ": " + path);
}

Mission read_by_format(const std::filesystem::path& file) {
  const std::string head = base::read_head(file);
  const std::optional<Format> format = format_of(head);
  if (!format) {
    if (const auto refusal = base::refusal_of_kind(head, "a mission")) throw InputError(file.string(), *refusal);
    throw InputError(
        file.string(),
        "is no mission that can be read: give a .plan of QGroundControl, a \"QGC WPL\" file, a KMZ of DJI, "
        "a CSV of Litchi or a KML route");
  }
  if (*format == Format::kZip) return read_kmz(file);
  if (*format == Format::kKml) return read_kml_mission(base::read_raw(file, kMostBytes), file.string());
  const std::string text = base::read_text(file, kMostBytes);
  if (*format == Format::kPlan) return read_plan(text, file.string());
  return *format == Format::kLitchi ? read_litchi(text, file.string()) : read_waypoint_list(text, file.string());
}

}  // namespace

bool is_mission_file(const std::filesystem::path& file) { return format_of(base::read_head(file)).has_value(); }

Mission read_mission(const std::filesystem::path& file) {
  Mission mission = read_by_format(file);
  if (mission.waypoints.size() > kMostWaypoints)
    throw InputError(file.string(), "has more than " + std::to_string(kMostWaypoints) + " waypoints; divide it");
  if (mission.waypoints.size() < 2) {
    throw InputError(file.string(), "has " + std::to_string(mission.waypoints.size()) +
                                        " waypoints to fly through, and a flight needs at least two" +
                                        (mission.notes.empty() ? "" : " (" + base::joined(mission.notes, "; ") + ")"));
  }
  return mission;
}

void require_on_earth(double latitude_deg, double longitude_deg, const std::string& where) {
  // Both at exactly zero is what programs write for "none".
  if (std::abs(latitude_deg) <= 90.0 && std::abs(longitude_deg) <= 180.0 &&
      (latitude_deg != 0.0 || longitude_deg != 0.0))
    return;
  throw InputError(where,
                   base::formatted("latitude %g, longitude %g is no place of a flight", latitude_deg, longitude_deg));
}

}  // namespace tileflight::missions
