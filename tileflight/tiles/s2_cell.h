#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "tileflight/geometry/transform.h"

namespace tileflight::tiles {

/// A cell of the S2 hierarchy (s2geometry.io, "S2 Cell Hierarchy"): a square of the grid of 2^level by 2^level squares
/// on one of the six faces of a cube about the globe.
struct S2Cell {
  std::uint32_t face = 0;
  std::uint32_t level = 0;  ///< 0: the whole face; 30: about a centimetre
  std::uint32_t i = 0;      ///< along u
  std::uint32_t j = 0;      ///< along v
};

inline constexpr std::uint32_t kFinestS2Level = 30;

/// The cell of a 64-bit S2CellId; nullopt: it is none.
std::optional<S2Cell> s2_cell_of_id(std::uint64_t id);

/// The cell of a token: the id in hexadecimal without the zeros at its end. nullopt: it is none.
std::optional<S2Cell> s2_cell_of_token(std::string_view token);

/// The cell `levels` further down, `x` along u and `y` along v of the 2^levels by 2^levels of them.
S2Cell s2_descendant(const S2Cell& cell, std::uint32_t levels, std::uint32_t x, std::uint32_t y);

/// Unit normal of the ellipsoid at a place of the cell, `s` and `t` from 0 to 1 along u and v. S2 knows a sphere: its
/// latitude there is taken for the geodetic one, as 3DTILES_bounding_volume_S2 is read everywhere.
geometry::Vec3 s2_normal(const S2Cell& cell, double s, double t);

}  // namespace tileflight::tiles
