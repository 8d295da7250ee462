#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::tileset {

/// A cell of the S2 hierarchy (s2geometry.io, "S2 Cell Hierarchy"): a square of the grid of 2^level by 2^level squares
/// on one of the six faces of a cube around the globe.
struct S2Cell {
  std::uint32_t face = 0;
  std::uint32_t level = 0;  ///< 0: the whole face; 30: about a centimetre
  std::uint32_t i = 0;      ///< along u
  std::uint32_t j = 0;      ///< along v
};

/// Level of the smallest cells.
inline constexpr std::uint32_t kMaxS2Level = 30;

/// Returns the cell of a 64-bit S2CellId; nullopt if the id is invalid.
std::optional<S2Cell> s2_cell_from_id(std::uint64_t id);

/// Returns the cell of a token, which is the id in hexadecimal without trailing zeros; nullopt if the token is invalid.
std::optional<S2Cell> s2_cell_from_token(std::string_view token);

/// Returns the descendant `levels` further down: `x` along u and `y` along v of the 2^levels by 2^levels descendants.
S2Cell s2_descendant(const S2Cell& cell, std::uint32_t levels, std::uint32_t x, std::uint32_t y);

/// Returns the unit normal of the ellipsoid at a point of the cell, `s` and `t` from 0 to 1 along u and v. S2 is
/// defined on a sphere: its latitude is taken as geodetic, the usual interpretation of 3DTILES_bounding_volume_S2.
geometry::Vec3 s2_normal(const S2Cell& cell, double s, double t);

}  // namespace tileflight::tileset
