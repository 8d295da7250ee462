#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstddef>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/telemetry.h"

namespace tileflight::flight_logs {

namespace {

/// Meaning of a flight log's column. Heights are listed in order of preference.
enum class Quantity {
  kTime,      ///< a number or a date with time
  kDateTime,  ///< a date with time beside a column of numbers
  kDate,      ///< a date alone
  kLatitude,
  kLongitude,
  kHeightEllipsoid,
  kHeightSeaLevel,
  kHeightUnknown,
  kHeightTakeoff,
  kBodyYaw,
  kBodyPitch,
  kBodyRoll,
  kGimbalYaw,
  kGimbalPitch,
  kGimbalRoll,
};
inline constexpr std::size_t kQuantities = 15;

/// Column index of a quantity, and the factor that converts its numbers to seconds, metres or degrees.
struct Column {
  std::size_t index = 0;
  std::optional<double> scale;  ///< nullopt: the column name states no unit
};

/// The columns of a table by quantity.
class ColumnMap {
 public:
  /// Parses the column names. Case, blanks and punctuation are ignored; a unit is in brackets ("altitude(feet)") or a
  /// suffix ("time_ms", "gimbalPitchRad"). Throws InputError (`where`, column, unit) for an unknown unit, if no other
  /// column holds that quantity.
  ColumnMap(const std::vector<std::string>& names, const std::string& where);

  /// Returns the quantity's column; nullopt if there is none.
  std::optional<Column> at(Quantity quantity) const {
    const std::vector<Column>& all = of(quantity);
    return all.empty() ? std::nullopt : std::optional(all.front());
  }

  /// Leaves the first column of each quantity for which `can_be_read` holds, if it holds for any.
  void choose(const std::function<bool(Quantity quantity, const Column& column)>& can_be_read);

 private:
  const std::vector<Column>& of(Quantity quantity) const { return columns_[static_cast<std::size_t>(quantity)]; }

  std::array<std::vector<Column>, kQuantities> columns_;  ///< the preferred one first
};

struct Alias {
  std::string_view name;  ///< lower case, letters and digits only
  Quantity quantity;
};

/// If two columns have the same meaning, the alias listed first wins. docs/formats.md has the list.
constexpr Alias kAliases[] = {
    {"fieldheaderstamp", Quantity::kTime},  // ROS: field.header.stamp, the time of the measurement
    {"time", Quantity::kTime},
    {"timestamp", Quantity::kTime},
    {"t", Quantity::kTime},
    {"seconds", Quantity::kTime},
    {"elapsed", Quantity::kTime},
    {"elapsedtime", Quantity::kTime},
    {"flighttime", Quantity::kTime},
    {"osdflytime", Quantity::kTime},
    {"datetime", Quantity::kDateTime},
    {"utc", Quantity::kDateTime},
    {"utctime", Quantity::kDateTime},
    {"timeutc", Quantity::kDateTime},
    {"datetimeoriginal", Quantity::kDateTime},
    {"date", Quantity::kDate},
    {"latitude", Quantity::kLatitude},
    {"lat", Quantity::kLatitude},
    {"gpslatitude", Quantity::kLatitude},
    {"gpslat", Quantity::kLatitude},
    {"osdlatitude", Quantity::kLatitude},
    {"fieldlatitude", Quantity::kLatitude},
    {"longitude", Quantity::kLongitude},
    {"lon", Quantity::kLongitude},
    {"lng", Quantity::kLongitude},
    {"long", Quantity::kLongitude},
    {"gpslongitude", Quantity::kLongitude},
    {"gpslon", Quantity::kLongitude},
    {"osdlongitude", Quantity::kLongitude},
    {"fieldlongitude", Quantity::kLongitude},
    {"fieldaltitude", Quantity::kHeightEllipsoid},  // sensor_msgs/NavSatFix: above the WGS 84 ellipsoid
    {"heightellipsoid", Quantity::kHeightEllipsoid},
    {"ellipsoidheight", Quantity::kHeightEllipsoid},
    {"ellipsoidalheight", Quantity::kHeightEllipsoid},
    {"altitudeellipsoid", Quantity::kHeightEllipsoid},
    {"altellipsoid", Quantity::kHeightEllipsoid},
    {"hae", Quantity::kHeightEllipsoid},
    {"altitudeabovesealevel", Quantity::kHeightSeaLevel},
    {"heightabovesealevel", Quantity::kHeightSeaLevel},
    {"heightsealevel", Quantity::kHeightSeaLevel},
    {"hmsl", Quantity::kHeightSeaLevel},
    {"altitudemsl", Quantity::kHeightSeaLevel},
    {"altmsl", Quantity::kHeightSeaLevel},
    {"heightmsl", Quantity::kHeightSeaLevel},
    {"altitudeamsl", Quantity::kHeightSeaLevel},
    {"altamsl", Quantity::kHeightSeaLevel},
    {"amsl", Quantity::kHeightSeaLevel},
    {"msl", Quantity::kHeightSeaLevel},
    {"elevation", Quantity::kHeightSeaLevel},
    {"ele", Quantity::kHeightSeaLevel},
    {"absalt", Quantity::kHeightUnknown},
    {"absolutealtitude", Quantity::kHeightUnknown},
    {"gpsaltitude", Quantity::kHeightUnknown},
    {"gpsalt", Quantity::kHeightUnknown},
    {"altitude", Quantity::kHeightUnknown},
    {"alt", Quantity::kHeightUnknown},
    {"height", Quantity::kHeightUnknown},
    {"osdaltitude", Quantity::kHeightUnknown},
    {"heightabovetakeoff", Quantity::kHeightTakeoff},
    {"altitudeabovetakeoff", Quantity::kHeightTakeoff},
    {"heighttakeoff", Quantity::kHeightTakeoff},
    {"relativealtitude", Quantity::kHeightTakeoff},
    {"relativeheight", Quantity::kHeightTakeoff},
    {"relalt", Quantity::kHeightTakeoff},
    {"osdheight", Quantity::kHeightTakeoff},
    {"yaw", Quantity::kBodyYaw},
    {"heading", Quantity::kBodyYaw},
    {"compassheading", Quantity::kBodyYaw},
    {"flightyawdegree", Quantity::kBodyYaw},
    {"osdyaw", Quantity::kBodyYaw},
    {"pitch", Quantity::kBodyPitch},
    {"flightpitchdegree", Quantity::kBodyPitch},
    {"osdpitch", Quantity::kBodyPitch},
    {"roll", Quantity::kBodyRoll},
    {"flightrolldegree", Quantity::kBodyRoll},
    {"osdroll", Quantity::kBodyRoll},
    {"gimbalyaw", Quantity::kGimbalYaw},
    {"gimbalheading", Quantity::kGimbalYaw},
    {"gimbalyawdegree", Quantity::kGimbalYaw},
    {"gimbalpitch", Quantity::kGimbalPitch},
    {"gimbalpitchdegree", Quantity::kGimbalPitch},
    {"gimbalroll", Quantity::kGimbalRoll},
    {"gimbalrolldegree", Quantity::kGimbalRoll},
};

struct Unit {
  std::string_view name;
  double scale;
};

constexpr Unit kTimeUnits[] = {{"s", 1},           {"sec", 1},     {"second", 1},         {"seconds", 1},
                               {"ms", 1e-3},       {"msec", 1e-3}, {"millisecond", 1e-3}, {"milliseconds", 1e-3},
                               {"us", 1e-6},       {"usec", 1e-6}, {"microsecond", 1e-6}, {"microseconds", 1e-6},
                               {"ns", 1e-9},       {"nsec", 1e-9}, {"nanosecond", 1e-9},  {"nanoseconds", 1e-9},
                               {"\xC2\xB5s", 1e-6}};
constexpr Unit kLengthUnits[] = {{"m", 1},       {"meter", 1},     {"meters", 1},    {"metre", 1}, {"metres", 1},
                                 {"ft", 0.3048}, {"foot", 0.3048}, {"feet", 0.3048}, {"mm", 1e-3}, {"cm", 1e-2}};
constexpr Unit kAngleUnits[] = {{"deg", 1},
                                {"degree", 1},
                                {"degrees", 1},
                                {"\xC2\xB0", 1},
                                {"dege7", 1e-7},
                                {"e7", 1e-7},
                                {"rad", 180 / std::numbers::pi},
                                {"rads", 180 / std::numbers::pi},
                                {"radian", 180 / std::numbers::pi},
                                {"radians", 180 / std::numbers::pi}};

template <std::size_t N>
std::optional<double> scale_in(const Unit (&units)[N], std::string_view name) {
  const auto found = std::find_if(std::begin(units), std::end(units), [&](const Unit& u) { return u.name == name; });
  return found == std::end(units) ? std::nullopt : std::optional(found->scale);
}

std::optional<double> scale_of(Quantity quantity, std::string_view unit) {
  switch (quantity) {
    case Quantity::kTime:
      return scale_in(kTimeUnits, unit);
    case Quantity::kDateTime:
    case Quantity::kDate:
      return 1.0;  // "(utc)", "[local]": only differences of dates are used
    case Quantity::kHeightEllipsoid:
    case Quantity::kHeightSeaLevel:
    case Quantity::kHeightUnknown:
    case Quantity::kHeightTakeoff:
      return scale_in(kLengthUnits, unit);
    default:
      return scale_in(kAngleUnits, unit);
  }
}

std::string letters_and_digits(std::string_view text) {
  std::string kept;
  std::copy_if(text.begin(), text.end(), std::back_inserter(kept),
               [](unsigned char c) { return std::isalnum(c) != 0; });
  return kept;
}

const Alias* alias_of(std::string_view name) {
  const std::string bare = letters_and_digits(name);
  const auto found =
      std::find_if(std::begin(kAliases), std::end(kAliases), [&](const Alias& alias) { return alias.name == bare; });
  return found == std::end(kAliases) ? nullptr : found;
}

struct ColumnMeaning {
  const Alias* alias = nullptr;
  std::optional<double> scale;
  bool has_unknown_unit = false;
};

/// Parses "name(unit)" or "name [unit]"; the name itself may still end in a unit.
ColumnMeaning meaning_in_brackets(std::string_view name, std::size_t bracket) {
  const Alias* alias = alias_of(name.substr(0, bracket));
  if (alias == nullptr) return {};
  const std::string_view inner = name.substr(bracket + 1);
  const std::string unit(inner.substr(0, inner.find_first_of(")]")));
  const std::optional<double> scale = scale_of(alias->quantity, unit);
  return {alias, scale, !scale};
}

ColumnMeaning meaning_of(const std::string& name) {
  const std::size_t bracket = name.find_first_of("([");
  if (bracket != std::string::npos && bracket > 0) return meaning_in_brackets(name, bracket);
  if (const Alias* alias = alias_of(name)) return {alias, std::nullopt};
  if (const std::size_t last = name.find_last_of("_. "); last != std::string::npos) {
    if (const Alias* alias = alias_of(std::string_view(name).substr(0, last))) {
      if (const auto scale = scale_of(alias->quantity, std::string_view(name).substr(last + 1))) return {alias, scale};
    }
  }
  constexpr std::size_t kLongestName = 64;
  if (name.size() > kLongestName) return {};
  const std::string bare = letters_and_digits(name);  // "gimbalPitchRad"
  for (std::size_t length = 1; length < bare.size(); ++length) {
    const Alias* alias = alias_of(std::string_view(bare).substr(0, length));
    if (alias == nullptr || alias->quantity == Quantity::kDateTime || alias->quantity == Quantity::kDate) continue;
    if (const auto scale = scale_of(alias->quantity, std::string_view(bare).substr(length))) return {alias, scale};
  }
  return {};
}

ColumnMap::ColumnMap(const std::vector<std::string>& names, const std::string& where) {
  std::vector<std::pair<const Alias*, Column>> found;
  std::vector<std::pair<Quantity, std::string>> unknown;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = base::to_lower(names[i]);
    const ColumnMeaning meaning = meaning_of(name);
    if (meaning.has_unknown_unit) unknown.emplace_back(meaning.alias->quantity, name);
    if (meaning.alias != nullptr && !meaning.has_unknown_unit) found.push_back({meaning.alias, {i, meaning.scale}});
  }
  std::ranges::stable_sort(found, {}, &std::pair<const Alias*, Column>::first);
  for (const auto& [alias, column] : found) columns_[static_cast<std::size_t>(alias->quantity)].push_back(column);
  for (const auto& [quantity, name] : unknown)
    if (of(quantity).empty())
      throw InputError(
          where, "the unit of column '" + name.substr(0, 80) + "' is unknown; use s, ms, us, ns, m, ft, deg or rad");
}

void ColumnMap::choose(const std::function<bool(Quantity quantity, const Column& column)>& can_be_read) {
  for (std::size_t i = 0; i < kQuantities; ++i) {
    std::vector<Column>& all = columns_[i];
    const auto chosen =
        std::ranges::find_if(all, [&](const Column& c) { return can_be_read(static_cast<Quantity>(i), c); });
    if (chosen != all.end()) all = {*chosen};
  }
}

/// Reads a text table row by row: RFC 4180 (quoted cells may hold separators, line ends and doubled quotes), with a
/// configurable separator, any line end, and blanks ignored around unquoted cells.
class CsvReader {
 public:
  /// `text` must outlive this.
  CsvReader(std::string_view text, char separator) : rest_(text), separator_(separator) {}

  /// Reads the next row that is not blank into `cells`; false at the end.
  bool next(std::vector<std::string>& cells);

 private:
  std::string quoted_cell();
  std::string plain_cell();
  void read_row(std::vector<std::string>& cells);

  std::string_view rest_;
  char separator_;
};

std::string CsvReader::quoted_cell() {
  std::string cell;
  rest_.remove_prefix(1);
  while (!rest_.empty()) {
    const char c = rest_.front();
    rest_.remove_prefix(1);
    if (c != '"') {
      cell += c;
    } else if (rest_.starts_with('"')) {
      cell += '"';
      rest_.remove_prefix(1);
    } else {
      break;
    }
  }
  plain_cell();  // skips text between the closing quote and the separator
  return cell;
}

std::string CsvReader::plain_cell() {
  const auto ends = [&](char c) { return c == separator_ || c == '\n'; };
  const auto end = std::find_if(rest_.begin(), rest_.end(), ends);
  const std::string_view cell = rest_.substr(0, static_cast<std::size_t>(end - rest_.begin()));
  rest_.remove_prefix(cell.size());
  return std::string(base::trim(cell));
}

void CsvReader::read_row(std::vector<std::string>& cells) {
  cells.clear();
  while (true) {
    while (rest_.starts_with(' ') && separator_ != ' ') rest_.remove_prefix(1);
    cells.push_back(rest_.starts_with('"') ? quoted_cell() : plain_cell());
    if (rest_.empty()) return;
    const bool ends_row = rest_.front() == '\n';
    rest_.remove_prefix(1);
    if (ends_row) return;
  }
}

bool CsvReader::next(std::vector<std::string>& cells) {
  while (!rest_.empty()) {
    read_row(cells);
    if (std::any_of(cells.begin(), cells.end(), [](const std::string& cell) { return !cell.empty(); })) return true;
  }
  return false;
}

/// The most frequent of comma, semicolon and tab in a table's first line, outside quotes.
char detect_separator(std::string_view header) {
  std::size_t commas = 0, semicolons = 0, tabs = 0;
  bool quoted = false;
  for (const char c : header) {
    if (c == '"') quoted = !quoted;
    if (quoted) continue;
    commas += c == ',';
    semicolons += c == ';';
    tabs += c == '\t';
  }
  if (tabs > commas && tabs > semicolons) return '\t';
  return semicolons > commas ? ';' : ',';
}

using Cells = std::vector<std::string>;

std::string_view without_first_line(std::string_view text) {
  return text.substr(std::min(text.find('\n'), text.size() - 1) + 1);
}

/// Skips everything before the header: blank lines, Excel's `sep=;`, and the `#` of EuRoC's header.
std::string_view from_header(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = base::trim(text.substr(0, text.find('\n')));
    if (!line.empty() && !line.starts_with("sep=")) break;
    text = without_first_line(text);
  }
  if (text.starts_with('#')) text.remove_prefix(1);
  return text;
}

/// The table of positions in the file of a FlySight 2, whose lines begin with the table's name: $COL states the columns
/// of a table, $GNSS is a row of positions (https://flysight.ca/docs). Other text as it is. Throws InputError.
std::string flysight_positions(std::string text, const std::string& where) {
  if (!text.starts_with("$FLYS")) return text;
  constexpr std::string_view kColumns = "$COL,GNSS,", kRow = "$GNSS,";
  std::string table;
  std::string_view rest = text;
  while (const auto line = base::take_line(rest)) {
    std::string_view row = *line;
    if (base::take_prefix(row, table.empty() ? kColumns : kRow)) table += std::string(row) + "\n";
  }
  if (table.empty()) throw InputError(where, "is a FlySight's file without positions: give its TRACK.CSV");
  return table;
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
  const auto is_number = [](const std::string& name) { return base::parse_finite_number(name).has_value(); };
  constexpr std::ptrdiff_t kSeveral = 3;
  if (std::ranges::count_if(names, is_number) >= kSeveral)
    throw InputError(where, "has no header, as `ros2 topic echo --csv` writes it: its first line holds numbers (" +
                                listed(names) +
                                "); add a line that names the columns, as time,latitude,longitude,height");
  throw InputError(where, "no column for " + missing + " in its first line, which has: " + listed(names) +
                              "; docs/formats.md lists the known names");
}

/// A date whose year comes last, as written: `17.05.2021`, `5/17/2021`.
struct YearLast {
  int first = 0, second = 0, year = 0;
  char separator = '/';
  std::string_view behind;  ///< the text after it
};

std::optional<YearLast> take_year_last(std::string_view text) {
  YearLast date;
  text = base::trim(text);
  const auto first = base::take_digits(text);
  if (!first || text.empty() || std::string_view("./-").find(text.front()) == std::string_view::npos) return {};
  date.separator = text.front();
  text.remove_prefix(1);
  const auto second = base::take_digits(text);
  if (!second || !base::take_prefix(text, std::string_view(&date.separator, 1))) return {};
  const auto year = base::take_digits(text);
  if (!year || *year < 1000 || *year > 9999) return {};
  date.first = *first, date.second = *second, date.year = *year;
  date.behind = text;
  return date;
}

/// Tells whether the day or the month comes first in a table's dates whose year comes last: by a number above 12, or by
/// dots, which countries use that write the day first. Throws InputError where different dates leave it open; if there
/// is one date only, it does not matter, since times count from the first row.
class DateOrder {
 public:
  void add(std::string_view text) {
    const auto date = take_year_last(text);
    if (!date) return;
    day_first_ = day_first_ || date->first > 12 || date->separator == '.';
    month_first_ = month_first_ || date->second > 12;
    const std::string written(base::trim(text.substr(0, text.size() - date->behind.size())));
    differs_ = differs_ || (!one_.empty() && one_ != written);
    one_ = written;
  }
  void require_known(const std::string& where) const {
    if (day_first_ == month_first_ && differs_)
      throw InputError(where, "its dates may have the day or the month first ('" + one_.substr(0, 20) +
                                  "'); write them as year-month-day");
  }
  /// The date and what follows it, with the year first; any other text as it is.
  std::string year_first(const std::string& text) const {
    const auto date = take_year_last(text);
    if (!date) return text;
    return base::formatted("%04d-%02d-%02d", date->year, day_first_ ? date->second : date->first,
                           day_first_ ? date->first : date->second) +
           std::string(date->behind);
  }

 private:
  bool day_first_ = false, month_first_ = false, differs_ = false;
  std::string one_;
};

/// Reads one table: its columns, and the meaning of its cells.
class Reader {
 public:
  Reader(const Cells& names, char separator, const std::string& where)
      : columns_(names, where), decimal_comma_(separator != ',') {
    require_columns(columns_, names, where);
    choose_height(names);
  }

  /// Learns from all rows in which order dates are written. Throws InputError (`where`) if that stays open.
  void learn_dates(CsvReader rows, const std::string& where) {
    for (Cells cells; rows.next(cells);)
      for (const Quantity quantity : {Quantity::kTime, Quantity::kDateTime, Quantity::kDate})
        dates_.add(cell(cells, quantity));
    dates_.require_known(where);
  }

  /// Chooses, where several columns hold a quantity, the first that can be read in any of these rows: a text such as
  /// "0m 0.1s" may stand in front of the same time in seconds.
  void choose_columns(const std::vector<Cells>& first_rows) {
    columns_.choose([&](Quantity quantity, const Column& column) {
      return std::ranges::any_of(first_rows, [&](const Cells& cells) {
        if (column.index >= cells.size()) return false;
        const std::string& text = cells[column.index];
        if (quantity == Quantity::kDate) return !text.empty();
        const bool is_date =
            (quantity == Quantity::kTime || quantity == Quantity::kDateTime) &&
            (base::parse_iso_time_s(dates_.year_first(text)) || base::parse_iso_time_s("2000-01-01 " + text));
        return is_date || parsed(text) || base::parse_angle_deg(text);
      });
    });
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
    const std::optional<Column> column = columns_.at(quantity);
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

  /// A number, or an angle with a degree sign and a hemisphere.
  std::optional<double> angle(const Cells& cells, Quantity quantity) const {
    if (const std::optional<double> value = number(cells, quantity)) return value;
    return base::parse_angle_deg(cell(cells, quantity));
  }

  std::optional<double> time(const Cells& cells) {
    if (const std::optional<double> value = parsed(cell(cells, Quantity::kTime))) {
      return *value * columns_.at(Quantity::kTime)->scale.value_or(scale_of_bare_time(*value));
    }
    const std::string text = dates_.year_first(cell(cells, Quantity::kTime)),
                      date = dates_.year_first(cell(cells, Quantity::kDate));
    if (const std::optional<double> date_s = base::parse_iso_time_s(date + " " + text); !date.empty() && date_s)
      return date_s;
    if (const std::optional<double> date_s = base::parse_iso_time_s(text)) return date_s;
    return base::parse_iso_time_s(dates_.year_first(cell(cells, Quantity::kDateTime)));
  }

  /// Scale of times in a column without a unit, by the first one.
  double scale_of_bare_time(double value) {
    if (!bare_time_scale_) bare_time_scale_ = base::guess_time_unit(value).seconds;
    return *bare_time_scale_;
  }

  ColumnMap columns_;
  bool decimal_comma_;
  DateOrder dates_;
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
  const std::string bytes = flysight_positions(base::read_text(file, base::kMaxLogBytes), file.string());
  const std::string_view text = from_header(bytes);
  const char separator = detect_separator(text.substr(0, text.find('\n')));
  CsvReader rows(text, separator);
  Cells cells;
  if (!rows.next(cells)) throw InputError(file.string(), "is empty; expected a flight log");
  Reader reader(cells, separator, file.string());
  constexpr std::size_t kFirstRows = 50;
  std::vector<Cells> first_rows;
  for (CsvReader ahead = rows; first_rows.size() < kFirstRows && ahead.next(cells);) first_rows.push_back(cells);
  reader.learn_dates(rows, file.string());
  reader.choose_columns(first_rows);
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
