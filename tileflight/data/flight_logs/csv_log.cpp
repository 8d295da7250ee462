#include "tileflight/data/flight_logs/csv_log.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/csv_columns.h"
#include "tileflight/data/flight_logs/csv_reader.h"
#include "tileflight/data/flight_logs/fix_filter.h"

namespace tileflight::flight_logs {
namespace {

using Cells = std::vector<std::string>;

std::string_view without_first_line(std::string_view text) {
  return text.substr(std::min(text.find('\n'), text.size() - 1) + 1);
}

/// Skips everything before the header: blank lines, Excel's `sep=;`, and the `#` of EuRoC's header.
std::string_view from_header(std::string_view text) {
  text = base::strip_byte_order_mark(text);
  while (!text.empty()) {
    const std::string_view line = base::trim(text.substr(0, text.find('\n')));
    if (!line.empty() && !line.starts_with("sep=")) break;
    text = without_first_line(text);
  }
  if (text.starts_with('#')) text.remove_prefix(1);
  return text;
}

/// Column names for a one-line error message: printable, and limited in number.
std::string listed(const Cells& names) {
  constexpr std::size_t kLongest = 300;
  std::string list;
  for (const std::string& name : names) {
    if (list.size() > kLongest) return list + ", ...";
    if (!list.empty()) list += ", ";
    for (const char c : name.substr(0, 60)) list += c >= ' ' && c < 127 ? c : '?';
  }
  return list;
}

void require_columns(const ColumnMap& columns, const Cells& names, const std::string& where) {
  const bool has_time = columns.at(Quantity::kTime) || columns.at(Quantity::kDateTime);
  std::string missing = has_time ? "" : "time";
  if (!columns.at(Quantity::kLatitude)) missing += missing.empty() ? "latitude" : ", latitude";
  if (!columns.at(Quantity::kLongitude)) missing += missing.empty() ? "longitude" : ", longitude";
  if (missing.empty()) return;
  throw InputError(where, "no column for " + missing + " in its first line, which has: " + listed(names) +
                              "; docs/formats.md lists the known names");
}

/// Reads one table: its columns, and the meaning of its cells.
class Reader {
 public:
  Reader(const Cells& names, char separator, const std::string& where)
      : columns_(names, where), decimal_comma_(separator != ',') {
    require_columns(columns_, names, where);
    choose_height(names);
  }

  /// The row's fix with its time as written; without a fix nullopt, counted by the filter.
  std::optional<TelemetryFix> fix(const Cells& cells, FixFilter& filter) {
    TelemetryFix fix;
    const std::optional<double> time_s = time(cells);
    const std::optional<double> latitude_deg = angle(cells, Quantity::kLatitude);
    const std::optional<double> longitude_deg = angle(cells, Quantity::kLongitude);
    if (!time_s) {
      filter.drop_without_time();
      return std::nullopt;
    }
    if (!latitude_deg || !longitude_deg) {
      filter.drop_without_fix();
      return std::nullopt;
    }
    fix.time_s = *time_s;
    fix.latitude_deg = *latitude_deg;
    fix.longitude_deg = *longitude_deg;
    if (height_) fix.absolute_height_m = number(cells, *height_);
    fix.height_above_takeoff_m = number(cells, Quantity::kHeightTakeoff);
    fix.body_yaw_deg = number(cells, Quantity::kBodyYaw);
    fix.body_pitch_deg = number(cells, Quantity::kBodyPitch);
    fix.body_roll_deg = number(cells, Quantity::kBodyRoll);
    fix.gimbal_yaw_deg = number(cells, Quantity::kGimbalYaw);
    fix.gimbal_pitch_deg = number(cells, Quantity::kGimbalPitch);
    fix.gimbal_roll_deg = number(cells, Quantity::kGimbalRoll);
    return fix;
  }

  HeightDatum height_datum() const { return datum_; }

 private:
  /// The column "height" of a dataset's own gps.csv is above the ellipsoid; the file is recognized by its two sigma
  /// columns.
  void choose_height(const Cells& names) {
    const auto has = [&](const char* name) { return std::find(names.begin(), names.end(), name) != names.end(); };
    if (columns_.at(Quantity::kHeightEllipsoid)) {
      height_ = Quantity::kHeightEllipsoid;
      datum_ = HeightDatum::kEllipsoid;
    } else if (columns_.at(Quantity::kHeightSeaLevel)) {
      height_ = Quantity::kHeightSeaLevel;
      datum_ = HeightDatum::kMeanSeaLevel;
    } else if (columns_.at(Quantity::kHeightUnknown)) {
      height_ = Quantity::kHeightUnknown;
      if (has("horizontal_sigma") && has("vertical_sigma")) datum_ = HeightDatum::kEllipsoid;
    }
  }

  /// The cell's text; empty if the quantity has no column or the row is shorter.
  std::string cell(const Cells& cells, Quantity quantity) const {
    const std::optional<Column>& column = columns_.at(quantity);
    return column && column->index < cells.size() ? cells[column->index] : "";
  }

  std::optional<double> parsed(std::string text) const {
    if (decimal_comma_) std::replace(text.begin(), text.end(), ',', '.');
    return base::parse_finite_number(text);
  }

  std::optional<double> number(const Cells& cells, Quantity quantity) const {
    const std::optional<double> value = parsed(cell(cells, quantity));
    if (!value) return std::nullopt;
    return *value * columns_.at(quantity)->scale.value_or(1.0);
  }

  /// A number, or degrees, minutes and seconds as written by ExifTool: `8 deg 27' 55.22" S`.
  std::optional<double> angle(const Cells& cells, Quantity quantity) const {
    if (const std::optional<double> value = number(cells, quantity)) return value;
    const std::string text = cell(cells, quantity);
    std::string_view rest = text;
    std::optional<double> degrees = base::take_number(rest);
    if (!degrees) return std::nullopt;
    rest = base::trim(rest);
    if (!base::take_prefix(rest, "deg")) base::take_prefix(rest, "\xC2\xB0");
    double part = 60.0;
    for (const std::string_view mark : {"'", "\""}) {
      std::string_view ahead = rest;
      const std::optional<double> value = base::take_number(ahead);
      ahead = base::trim(ahead);
      if (value && base::take_prefix(ahead, mark)) {
        *degrees += *value / part;
        rest = ahead;
      }
      part *= 60.0;
    }
    rest = base::trim(rest);
    if (rest == "S" || rest == "W") return -*degrees;
    return rest == "N" || rest == "E" ? degrees : std::nullopt;
  }

  std::optional<double> time(const Cells& cells) {
    if (const std::optional<double> value = parsed(cell(cells, Quantity::kTime))) {
      return *value * columns_.at(Quantity::kTime)->scale.value_or(scale_of_bare_time(*value));
    }
    const std::string text = cell(cells, Quantity::kTime), date = cell(cells, Quantity::kDate);
    if (const std::optional<double> date_s = base::parse_iso_time_s(date + " " + text); !date.empty() && date_s)
      return date_s;
    if (const std::optional<double> date_s = base::parse_iso_time_s(text)) return date_s;
    return base::parse_iso_time_s(cell(cells, Quantity::kDateTime));
  }

  /// Scale of times in a column without a unit: seconds, unless the first one would be a date after the year 5000; then
  /// dates of this century in milliseconds, microseconds or nanoseconds.
  double scale_of_bare_time(double value) {
    if (!bare_time_scale_) {
      bare_time_scale_ = value < 1e11 ? 1.0 : value < 1e14 ? 1e-3 : value < 1e17 ? 1e-6 : 1e-9;
    }
    return *bare_time_scale_;
  }

  ColumnMap columns_;
  bool decimal_comma_;
  std::optional<Quantity> height_;
  HeightDatum datum_ = HeightDatum::kUnknown;
  std::optional<double> bare_time_scale_;
};

/// Sorts fixes by time. Tables of photos are ordered by names or folders. Only dates are sorted: a clock that starts
/// with a recording may have been restarted.
bool sorted_by_date(std::vector<TelemetryFix>& fixes) {
  const auto earlier = [](const TelemetryFix& a, const TelemetryFix& b) { return a.time_s < b.time_s; };
  const bool dates =
      std::all_of(fixes.begin(), fixes.end(), [](const TelemetryFix& f) { return is_unix_time(f.time_s); });
  if (!dates || std::is_sorted(fixes.begin(), fixes.end(), earlier)) return false;
  std::stable_sort(fixes.begin(), fixes.end(), earlier);
  return true;
}

}  // namespace

Telemetry read_csv_log(const std::filesystem::path& file) {
  const std::string bytes = base::read_text(file, base::kMaxLogBytes);
  const std::string_view text = from_header(bytes);
  const char separator = detect_separator(text.substr(0, text.find('\n')));
  CsvReader rows(text, separator);
  Cells cells;
  if (!rows.next(cells)) throw InputError(file.string(), "is empty; expected a flight log");
  Reader reader(cells, separator, file.string());
  FixFilter filter;
  std::vector<TelemetryFix> fixes;
  while (rows.next(cells)) {
    if (const std::optional<TelemetryFix> fix = reader.fix(cells, filter)) fixes.push_back(*fix);
  }
  const bool was_sorted = sorted_by_date(fixes);
  for (const TelemetryFix& fix : fixes) filter.add(fix);
  Telemetry telemetry = std::move(filter).finish(file.string(), "rows");
  if (was_sorted) telemetry.warnings.push_back("the rows were not in order of time and have been sorted");
  rebase_unix_times(telemetry);
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = reader.height_datum();
  return telemetry;
}

}  // namespace tileflight::flight_logs
