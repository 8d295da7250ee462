#include "tileflight/tiles/tileset/s2_cell.h"

#include <array>
#include <bit>
#include <cmath>

namespace tileflight::tileset {
namespace {

/// The four quarters of a cell, each numbered 2 i + j, are visited by the Hilbert curve in one of four orders, given by
/// the cell's orientation. Each quarter has its own orientation.
constexpr unsigned kSwapped = 1;
constexpr unsigned kInverted = 2;
constexpr std::array<std::array<unsigned, 4>, 4> kQuarters = {{{0, 1, 3, 2}, {0, 2, 3, 1}, {3, 2, 0, 1}, {3, 1, 0, 2}}};
constexpr std::array<unsigned, 4> kTurns = {kSwapped, 0, 0, kSwapped | kInverted};

/// The quadratic projection: from 0..1 on the grid to -1..1 on the cube, such that cells have similar sizes.
double cube_from_grid(double s) { return s >= 0.5 ? (4 * s * s - 1) / 3 : (1 - 4 * (1 - s) * (1 - s)) / 3; }

geometry::Vec3 direction(std::uint32_t face, double u, double v) {
  switch (face) {
    case 0:
      return {1, u, v};
    case 1:
      return {-u, 1, v};
    case 2:
      return {-u, -v, 1};
    case 3:
      return {-1, -v, -u};
    case 4:
      return {v, -1, -u};
    default:
      return {v, u, -1};
  }
}

}  // namespace

std::optional<S2Cell> s2_cell_from_id(std::uint64_t id) {
  constexpr std::uint64_t kEnds = 0x1555555555555555;  // possible positions of the terminating 1 bit of an id
  const std::uint64_t end = id & (~id + 1);
  if ((end & kEnds) == 0 || id >> 61U > 5) return std::nullopt;
  S2Cell cell;
  cell.face = static_cast<std::uint32_t>(id >> 61U);
  cell.level = kMaxS2Level - static_cast<std::uint32_t>(std::countr_zero(end)) / 2;
  unsigned orientation = cell.face & kSwapped;
  for (std::uint32_t level = 1; level <= cell.level; ++level) {
    const auto position = static_cast<unsigned>(id >> (61 - 2 * level)) & 3U;
    const unsigned quarter = kQuarters[orientation][position];
    cell.i = cell.i << 1U | quarter >> 1U;
    cell.j = cell.j << 1U | (quarter & 1U);
    orientation ^= kTurns[position];
  }
  return cell;
}

std::optional<S2Cell> s2_cell_from_token(std::string_view token) {
  constexpr std::size_t kDigits = 16;
  if (token.empty() || token.size() > kDigits) return std::nullopt;
  std::uint64_t id = 0;
  for (const char c : token) {
    const bool is_number = c >= '0' && c <= '9';
    const bool is_letter = (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F');
    if (!is_number && !is_letter) return std::nullopt;
    id = id << 4U | static_cast<unsigned>(is_number ? c - '0' : (c | 0x20) - 'a' + 10);
  }
  return s2_cell_from_id(id << (4 * (kDigits - token.size())));
}

S2Cell s2_descendant(const S2Cell& cell, std::uint32_t levels, std::uint32_t x, std::uint32_t y) {
  return {cell.face, cell.level + levels, (cell.i << levels) + x, (cell.j << levels) + y};
}

geometry::Vec3 s2_normal(const S2Cell& cell, double s, double t) {
  const double size = std::ldexp(1.0, -static_cast<int>(cell.level));
  return direction(cell.face, cube_from_grid((cell.i + s) * size), cube_from_grid((cell.j + t) * size)).normalized();
}

}  // namespace tileflight::tileset
