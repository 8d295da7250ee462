#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::flight_logs {

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
  /// suffix ("time_ms"). Throws InputError (`where`, column, unit) for an unknown unit.
  ColumnMap(const std::vector<std::string>& names, const std::string& where);

  const std::optional<Column>& at(Quantity quantity) const { return columns_[static_cast<std::size_t>(quantity)]; }

 private:
  std::array<std::optional<Column>, kQuantities> columns_;
};

}  // namespace tileflight::flight_logs
