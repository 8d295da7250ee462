// NMEA 0183 as receivers write it: $GPGGA has time of day, position and heights, $GPRMC the date too. Fields as in the
// manuals of receivers, e.g. u-blox's "Interface description", NMEA protocol.
#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

namespace {

constexpr double kDay_s = 86400.0;

/// Splits at every comma: fields may be empty.
std::vector<std::string_view> nmea_fields(std::string_view sentence) {
  std::vector<std::string_view> fields;
  while (true) {
    const std::size_t comma = sentence.find(',');
    fields.push_back(base::trim(sentence.substr(0, comma)));
    if (comma == std::string_view::npos) return fields;
    sentence.remove_prefix(comma + 1);
  }
}

/// The sentence of a line, from "$" to "*"; empty if there is none.
struct Sentence {
  std::string_view body;    ///< "GPGGA,…"
  bool is_damaged = false;  ///< its checksum is another
};

Sentence sentence_of(std::string_view line) {
  const std::size_t begin = line.find('$');
  if (begin == std::string_view::npos) return {};
  line.remove_prefix(begin + 1);
  Sentence sentence{line.substr(0, line.find('*'))};
  unsigned sum = 0, stated = 0;
  for (const char c : sentence.body) sum ^= static_cast<unsigned char>(c);
  if (sentence.body.size() == line.size()) return sentence;
  const std::string_view digits = base::trim(line.substr(sentence.body.size() + 1));
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + std::min<std::size_t>(2, digits.size()), stated, 16);
  sentence.is_damaged = error != std::errc() || stated != sum;
  return sentence;
}

/// Whether a sentence is of this kind, of any satellite system ("GP", "GN", …).
bool is_kind(std::string_view body, std::string_view kind) {
  return body.size() > 6 && body.substr(2, 3) == kind && body[5] == ',';
}

/// hhmmss.ss as seconds of the day.
std::optional<double> nmea_clock_s(std::string_view field) {
  const std::optional<double> number = base::parse_finite_number(field);
  if (!number || field.size() < 6 || *number < 0.0 || *number >= 240000.0) return std::nullopt;
  const double hours = std::floor(*number / 1e4), minutes = std::floor(std::fmod(*number, 1e4) / 100);
  const double seconds = std::fmod(*number, 100.0);
  if (minutes >= 60.0 || seconds > 60.0) return std::nullopt;
  return 3600.0 * hours + 60.0 * minutes + seconds;
}

/// ddmm.mmmm with its hemisphere, degrees; nullopt if either is missing or wrong.
std::optional<double> nmea_angle_deg(std::string_view field, std::string_view hemisphere, std::string_view letters) {
  const std::optional<double> number = base::parse_finite_number(field);
  if (!number || *number < 0.0 || hemisphere.size() != 1) return std::nullopt;
  const std::size_t side = letters.find(hemisphere.front());
  const double degrees = std::floor(*number / 100.0), minutes = *number - 100.0 * degrees;
  if (side == std::string_view::npos || minutes >= 60.0) return std::nullopt;
  return (side == 0 ? 1.0 : -1.0) * (degrees + minutes / 60.0);
}

/// ddmmyy as seconds since 1970.
std::optional<double> nmea_day_s(std::string_view field) {
  if (field.size() != 6 || !std::ranges::all_of(field, base::is_digit)) return std::nullopt;
  const std::string text = "20" + std::string(field.substr(4)) + "-" + std::string(field.substr(2, 2)) + "-" +
                           std::string(field.substr(0, 2));
  std::string_view date = text;
  const std::optional<double> days = base::take_day(date);
  return days ? std::optional(kDay_s * *days) : std::nullopt;
}

class NmeaReader {
 public:
  void read(std::string_view line) {
    const Sentence sentence = sentence_of(line);
    if (sentence.is_damaged) {
      ++damaged_;
      return;
    }
    const std::vector<std::string_view> fields = nmea_fields(sentence.body);
    if (is_kind(sentence.body, "GGA") && fields.size() >= 12) read_gga(fields);
    if (is_kind(sentence.body, "RMC") && fields.size() >= 10) read_rmc(fields);
  }

  Telemetry finish(const std::string& where) && {
    const bool by_gga = !gga_.empty();
    std::vector<Entry>& entries = by_gga ? gga_ : rmc_;
    const bool all_ellipsoidal =
        by_gga && std::ranges::all_of(entries, [](const Entry& e) { return e.separation_m.has_value(); });
    FixFilter filter;
    for (Entry& entry : entries) {
      if (!entry.time_s) {
        filter.drop_without_time();
      } else if (!entry.has_position) {
        filter.drop_without_fix();
      } else {
        entry.fix.time_s = *entry.time_s + first_day_s_.value_or(0.0);
        if (all_ellipsoidal && entry.fix.absolute_height_m) *entry.fix.absolute_height_m += *entry.separation_m;
        filter.add(entry.fix);
      }
    }
    std::vector<std::string> damage;
    if (damaged_ > 0) damage.push_back(std::to_string(damaged_) + " sentences dropped: their checksum is wrong");
    Telemetry telemetry = std::move(filter).finish(where, "GGA and RMC sentences", damage);
    base::add_distinct(damage, telemetry.warnings);
    if (first_day_s_)
      telemetry.zero_utc_s = telemetry.fixes.front().time_s;
    else
      telemetry.warnings.push_back("no sentence states the date (RMC), so the times are those of an unknown day");
    rebase_to_first_fix(telemetry);
    drop_fixes_without_height(telemetry);
    telemetry.height_datum = all_ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
    return telemetry;
  }

 private:
  struct Entry {
    std::optional<double> time_s;  ///< since midnight of the first day
    bool has_position = false;
    TelemetryFix fix;
    std::optional<double> separation_m;  ///< height of the geoid above the ellipsoid
  };

  /// Time of day on the running day: a step back by more than half a day is midnight.
  std::optional<double> time_of(std::optional<double> clock_s) {
    if (!clock_s) return std::nullopt;
    if (last_clock_s_ && *clock_s < *last_clock_s_ - 0.5 * kDay_s) day_s_ += kDay_s;
    last_clock_s_ = clock_s;
    return day_s_ + *clock_s;
  }

  void read_gga(const std::vector<std::string_view>& fields) {
    Entry entry = entry_of(fields[1], fields[2], fields[3], fields[4], fields[5]);
    entry.has_position = entry.has_position && fields[6] != "0" && !fields[6].empty();
    entry.fix.absolute_height_m = base::parse_finite_number(fields[9]);
    entry.separation_m = base::parse_finite_number(fields[11]);
    gga_.push_back(entry);
  }

  void read_rmc(const std::vector<std::string_view>& fields) {
    if (const std::optional<double> date_s = nmea_day_s(fields[9]); date_s && !first_day_s_) {
      first_day_s_ = *date_s - day_s_;  // midnight before the first entry
      const std::optional<double> clock_s = nmea_clock_s(fields[1]);
      // the first date may follow a midnight that no entry before it told
      if (clock_s && last_clock_s_ && *clock_s < *last_clock_s_ - 0.5 * kDay_s) *first_day_s_ -= kDay_s;
    }
    Entry entry = entry_of(fields[1], fields[3], fields[4], fields[5], fields[6]);
    entry.has_position = entry.has_position && fields[2] == "A";
    rmc_.push_back(entry);
  }

  Entry entry_of(std::string_view clock, std::string_view latitude, std::string_view north, std::string_view longitude,
                 std::string_view east) {
    Entry entry;
    entry.time_s = time_of(nmea_clock_s(clock));
    const std::optional<double> latitude_deg = nmea_angle_deg(latitude, north, "NS");
    const std::optional<double> longitude_deg = nmea_angle_deg(longitude, east, "EW");
    entry.has_position = latitude_deg && longitude_deg;
    entry.fix.latitude_deg = latitude_deg.value_or(0.0);
    entry.fix.longitude_deg = longitude_deg.value_or(0.0);
    return entry;
  }

  std::vector<Entry> gga_, rmc_;
  std::optional<double> last_clock_s_, first_day_s_;
  double day_s_ = 0.0;  ///< midnights that have passed
  std::size_t damaged_ = 0;
};

}  // namespace

bool is_nmea(std::string_view head) {
  constexpr std::size_t kLines = 50;
  for (std::size_t i = 0; i < kLines; ++i) {
    const auto line = base::take_line(head);
    if (!line) return false;
    const std::string_view body = sentence_of(*line).body;
    for (const std::string_view kind : {"GGA", "RMC", "GSA", "GSV", "VTG", "GLL", "ZDA"})
      if (is_kind(body, kind)) return true;
  }
  return false;
}

Telemetry read_nmea(const std::filesystem::path& file) {
  const std::string text = base::read_text(file, base::kMaxLogBytes);
  std::string_view rest = text;
  NmeaReader reader;
  while (const auto line = base::take_line(rest)) reader.read(*line);
  return std::move(reader).finish(file.string());
}

}  // namespace tileflight::flight_logs
