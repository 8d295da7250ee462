#include "tileflight/data/flight_logs/csv_columns.h"

#include <algorithm>
#include <cctype>
#include <numbers>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::flight_logs {
namespace {

struct Alias {
  std::string_view name;  ///< lower case, letters and digits only
  Quantity quantity;
};

/// If two columns have the same meaning, the alias listed first wins. docs/formats.md has the list.
constexpr Alias kAliases[] = {
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
    {"longitude", Quantity::kLongitude},
    {"lon", Quantity::kLongitude},
    {"lng", Quantity::kLongitude},
    {"long", Quantity::kLongitude},
    {"gpslongitude", Quantity::kLongitude},
    {"gpslon", Quantity::kLongitude},
    {"osdlongitude", Quantity::kLongitude},
    {"heightellipsoid", Quantity::kHeightEllipsoid},
    {"ellipsoidheight", Quantity::kHeightEllipsoid},
    {"ellipsoidalheight", Quantity::kHeightEllipsoid},
    {"altitudeellipsoid", Quantity::kHeightEllipsoid},
    {"altellipsoid", Quantity::kHeightEllipsoid},
    {"hae", Quantity::kHeightEllipsoid},
    {"altitudeabovesealevel", Quantity::kHeightSeaLevel},
    {"heightabovesealevel", Quantity::kHeightSeaLevel},
    {"heightsealevel", Quantity::kHeightSeaLevel},
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
};

/// Parses "name(unit)" or "name [unit]"; the name itself may still end in a unit.
ColumnMeaning meaning_in_brackets(std::string_view name, std::size_t bracket, const std::string& where) {
  const Alias* alias = alias_of(name.substr(0, bracket));
  if (alias == nullptr) return {};
  const std::string_view inner = name.substr(bracket + 1);
  const std::string unit(inner.substr(0, inner.find_first_of(")]")));
  const std::optional<double> scale = scale_of(alias->quantity, unit);
  if (scale) return {alias, scale};
  throw InputError(where, "the unit of column '" + std::string(name.substr(0, 80)) +
                              "' is unknown; use s, ms, us, ns, m, ft, deg or rad");
}

ColumnMeaning meaning_of(const std::string& name, const std::string& where) {
  const std::size_t bracket = name.find_first_of("([");
  if (bracket != std::string::npos && bracket > 0) return meaning_in_brackets(name, bracket, where);
  if (const Alias* alias = alias_of(name)) return {alias, std::nullopt};
  const std::size_t last = name.find_last_of("_. ");
  if (last == std::string::npos) return {};
  const Alias* alias = alias_of(std::string_view(name).substr(0, last));
  const std::optional<double> scale =
      alias == nullptr ? std::nullopt : scale_of(alias->quantity, std::string_view(name).substr(last + 1));
  return scale ? ColumnMeaning{alias, scale} : ColumnMeaning{};
}

}  // namespace

ColumnMap::ColumnMap(const std::vector<std::string>& names, const std::string& where) {
  std::array<const Alias*, kQuantities> chosen{};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const ColumnMeaning meaning = meaning_of(base::to_lower(names[i]), where);
    if (meaning.alias == nullptr) continue;
    const auto quantity = static_cast<std::size_t>(meaning.alias->quantity);
    if (chosen[quantity] != nullptr && chosen[quantity] <= meaning.alias) continue;
    chosen[quantity] = meaning.alias;
    columns_[quantity] = Column{i, meaning.scale};
  }
}

}  // namespace tileflight::flight_logs
