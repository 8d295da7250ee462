#include "tileflight/capture/recording/tile_shares.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <span>

#include "tileflight/core/geometry/mesh.h"

namespace tileflight::recording {
namespace {

constexpr std::size_t kCellsPerShare = 8;

/// Puts the tiles, of which `members` are numbers, into cells that are numbered from `first` on.
void deal(const std::vector<TileWork>& tiles, std::span<std::size_t> members, std::size_t first, std::size_t cells,
          std::vector<std::size_t>& cell_of) {
  if (cells == 1 || members.empty()) {
    for (const std::size_t i : members) cell_of[i] = first;
    return;
  }
  geometry::Box3 box;
  double total = 0.0;
  for (const std::size_t i : members) {
    box.extend(tiles[i].center);
    total += tiles[i].cost;
  }
  Eigen::Index axis = 0;
  box.sizes().maxCoeff(&axis);
  std::ranges::stable_sort(members, {}, [&](std::size_t i) { return std::pair(tiles[i].center[axis], i); });
  const std::size_t lower = cells / 2;
  const double wanted = total * static_cast<double>(lower) / static_cast<double>(cells);
  std::size_t count = 0;
  for (double cost = 0.0; count < members.size(); ++count) {
    const double next = tiles[members[count]].cost;
    if (cost + next / 2 > wanted) break;
    cost += next;
  }
  deal(tiles, members.first(count), first, lower, cell_of);
  deal(tiles, members.subspan(count), first + lower, cells - lower, cell_of);
}

}  // namespace

std::vector<std::size_t> deal_tiles(const std::vector<TileWork>& tiles, std::size_t shares) {
  std::vector<std::size_t> members(tiles.size()), share_of(tiles.size(), 0);
  std::iota(members.begin(), members.end(), std::size_t{0});
  deal(tiles, members, 0, kCellsPerShare * shares, share_of);
  for (std::size_t& cell : share_of) cell %= shares;
  return share_of;
}

std::string to_bytes(const TileUses& uses) {
  return {reinterpret_cast<const char*>(uses.data()), uses.size() * sizeof(TileUses::value_type)};
}

TileUses uses_from_bytes(const std::string& bytes) {
  TileUses uses(bytes.size() / sizeof(TileUses::value_type));
  if (!uses.empty()) std::memcpy(uses.data(), bytes.data(), uses.size() * sizeof(TileUses::value_type));
  return uses;
}

bool SharingCosts::is_tiles_better() const {
  // A byte of a file takes 0.2 us to decode (Draco, WebP); a pixel 0.1 us in each process, beside what it takes in one:
  // rays that miss, surfaces that another process's hide, and the exchange. Layers need no tree for single rays, which
  // takes a quarter of the time of decoding (docs/scale.md).
  constexpr double kBytesPerPixel = 0.5, kTreeShare = 0.25, kWorthwhile = 0.95;
  const double exchanged_bytes = kBytesPerPixel * pixels * static_cast<double>(processes);
  return tiles_dealt_bytes + exchanged_bytes < kWorthwhile * (frames_dealt_bytes + kTreeShare * scene_bytes);
}

}  // namespace tileflight::recording
