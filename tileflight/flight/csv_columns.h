#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::flight {

/// What a column of a flight log can say. In the order in which heights are preferred.
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

/// Where a quantity stands in a row, and what its numbers are multiplied with to be seconds, metres or degrees.
struct Column {
  std::size_t index = 0;
  std::optional<double> scale;  ///< nullopt: the name has no unit
};

/// The columns of a table by quantity.
class Columns {
 public:
  /// From the names in the first row. Names are compared without case, blanks and punctuation; a unit stands in
  /// brackets ("altitude(feet)") or at the end ("time_ms"). Throws InputError (`where`, a quantity's column, its unit)
  /// when a unit is not known.
  Columns(const std::vector<std::string>& names, const std::string& where);

  const std::optional<Column>& at(Quantity quantity) const { return columns_[static_cast<std::size_t>(quantity)]; }

 private:
  std::array<std::optional<Column>, kQuantities> columns_;
};

}  // namespace tileflight::flight
