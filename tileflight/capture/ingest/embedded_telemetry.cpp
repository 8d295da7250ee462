#include "tileflight/capture/ingest/embedded_telemetry.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "tileflight/core/base/file_kind.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/dataset/ingest.h"
#include "tileflight/data/flight_logs/metadata_tracks.h"
#include "tileflight/data/video/side_tracks.h"
#include "tileflight/data/video/video.h"

namespace tileflight::ingest {
namespace {

using flight_logs::Telemetry;

constexpr std::string_view kGoPro = "gpmd", kDji = "djmd";

std::optional<EmbeddedTelemetry> read_one(const std::filesystem::path& file) {
  constexpr std::array kKinds{kGoPro, kDji};
  if (const auto track = video::read_data_track(file, kKinds); track && !track->samples.empty()) {
    const std::vector<std::byte> settings = video::read_user_data(file, "GPMF");
    const flight_logs::MetadataSource source{
        .where = file.string(), .settings = settings, .quarter_turns = video::probe_video(file).quarter_turns};
    if (track->kind == kGoPro)
      return EmbeddedTelemetry{"GoPro's metadata (GPMF)", flight_logs::read_gpmf(track->samples, source)};
    return EmbeddedTelemetry{"DJI's metadata (djmd)", flight_logs::read_dji_metadata(track->samples, source)};
  }
  const std::string subtitles = video::read_subtitles(file);
  if (subtitles.empty()) return std::nullopt;
  return EmbeddedTelemetry{"subtitles", flight_logs::parse_dji_srt(subtitles, file.string() + " (subtitles)")};
}

/// Appends the entries of `from`, later by `start_s`, that come after those of `to`.
template <class Entry>
void append_later(const std::vector<Entry>& from, double start_s, std::vector<Entry>& to) {
  for (Entry entry : from) {
    entry.time_s += start_s;
    if (to.empty() || entry.time_s > to.back().time_s) to.push_back(std::move(entry));
  }
}

/// Appends the telemetry of a later part.
void append(const Telemetry& part, double start_s, const std::filesystem::path& file, Telemetry& telemetry) {
  if (telemetry.fixes.empty()) telemetry.height_datum = part.height_datum;
  if (!part.fixes.empty() && part.height_datum != telemetry.height_datum) {
    telemetry.height_datum = flight_logs::HeightDatum::kUnknown;
    telemetry.warnings.push_back(file.filename().string() +
                                 ": its heights have another reference than those of the parts before");
  }
  append_later(part.fixes, start_s, telemetry.fixes);
  append_later(part.body_rates, start_s, telemetry.body_rates);
  append_later(part.inertial, start_s, telemetry.inertial);
  append_later(part.exposures, start_s, telemetry.exposures);
  append_later(part.zooms, start_s, telemetry.zooms);
  if (!telemetry.zero_utc_s && part.zero_utc_s) telemetry.zero_utc_s = *part.zero_utc_s - start_s;
  if (telemetry.device.empty()) telemetry.device = part.device;
  for (const std::string& warning : part.warnings)
    telemetry.warnings.push_back(file.filename().string() + ": " + warning);
}

/// Holds what the name of a part says.
struct Chapter {
  std::string family;     ///< letters, which are the same for all parts but the first of the older names
  std::string recording;  ///< four digits
  int number = 0;         ///< of the part
};

/// GoPro, "File Naming Convention": GX, GH, GL and others, two digits of the part, from 1, four of the recording; older
/// cameras: GOPR and the recording for the first, GP, two digits from 1 and the recording for the next.
std::optional<Chapter> chapter_of(const std::filesystem::path& file) {
  const std::string name = base::to_lower(file.stem().string());
  const auto has_digits = [&](std::size_t from) {
    return name.size() == 8 &&
           std::all_of(name.begin() + static_cast<std::ptrdiff_t>(from), name.end(), base::is_digit);
  };
  if (name.starts_with("gopr") && has_digits(4)) return Chapter{"gp", name.substr(4), 0};
  const bool is_chapter = name.size() == 8 && name[0] == 'g' &&
                          std::string_view("hxlpms").find(name[1]) != std::string_view::npos && has_digits(2);
  if (!is_chapter) return std::nullopt;
  return Chapter{name.substr(0, 2), name.substr(4), 10 * (name[2] - '0') + (name[3] - '0')};
}

}  // namespace

bool is_video(const std::filesystem::path& file) {
  if (std::filesystem::is_directory(file)) return false;
  const auto kind = base::recognize_file(base::read_head(file));
  return kind && kind->is_video;
}

std::optional<EmbeddedTelemetry> read_embedded_telemetry(const std::vector<std::filesystem::path>& parts) {
  if (parts.empty() || !is_video(parts.front())) return std::nullopt;
  std::optional<EmbeddedTelemetry> found = read_one(parts.front());
  if (!found || parts.size() == 1) return found;
  const std::vector<double> starts_s = dataset::part_starts_s(parts);
  Telemetry joined;
  append(found->telemetry, 0.0, parts.front(), joined);
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const std::optional<EmbeddedTelemetry> next = read_one(parts[i]);
    if (next && next->kind == found->kind) {
      append(next->telemetry, starts_s[i], parts[i], joined);
    } else {
      joined.warnings.push_back(parts[i].filename().string() + ": has no " + found->kind + ", as the part before has");
    }
  }
  found->telemetry = std::move(joined);
  return found;
}

void check_chapters(const std::vector<std::filesystem::path>& parts) {
  for (std::size_t i = 1; i < parts.size(); ++i) {
    const auto before = chapter_of(parts[i - 1]), next = chapter_of(parts[i]);
    if (!before || !next) continue;
    const std::string names = parts[i - 1].filename().string() + " and " + parts[i].filename().string();
    if (before->family != next->family || before->recording != next->recording)
      throw InputError(parts[i].string(),
                       "by GoPro's names, " + names + " are of different recordings; ingest each alone");
    if (next->number != before->number + 1)
      throw InputError(parts[i].string(), "by GoPro's names, the part between " + names +
                                              " is missing, so all times after it would be wrong; give all parts, or "
                                              "those on one side of it");
  }
}

std::string describe(const EmbeddedTelemetry& found, const std::filesystem::path& video) {
  const Telemetry& telemetry = found.telemetry;
  std::vector<std::string> contents;
  const auto add = [&](std::size_t count, const char* of) {
    if (count > 0) contents.push_back(std::to_string(count) + " " + of);
  };
  if (!telemetry.device.empty()) contents.push_back(telemetry.device);
  add(telemetry.fixes.size(), "positions");
  add(telemetry.inertial.size(), "readings of the inertial unit");
  add(telemetry.exposures.size(), "exposures");
  return found.kind + " in " + video.filename().string() + ": " + base::joined(contents);
}

}  // namespace tileflight::ingest
