#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/geometry/transform.h"

// Tiles shared out among processes, each of which traces all frames against its own, and what that saves.
namespace tileflight::survey {

/// A tile, and what it costs to show it, in any unit.
struct TileWork {
  geometry::Vec3 center;
  double cost = 0.0;
};

/// The share, from 0 to `shares` - 1, of each tile. The place is halved across its longest side again and again, where
/// the costs of the halves are as the numbers of their cells, to half the cost of a tile in each step. Each share has
/// several of these cells, one of each neighbourhood, so that wherever a frame looks, its tiles are of all shares.
std::vector<std::size_t> deal_tiles(const std::vector<TileWork>& tiles, std::size_t shares);

/// In how many scenes a process would show each tile, if it rendered the frames of its range.
using TileUses = std::vector<std::uint32_t>;

std::string to_bytes(const TileUses& uses);
TileUses uses_from_bytes(const std::string& bytes);

/// What processes would read and exchange.
struct SharingCosts {
  double frames_dealt_bytes = 0.0;  ///< files that are read if each process renders a range of frames, all together
  double tiles_dealt_bytes = 0.0;   ///< files that are read if each process has a part of the tiles
  double scene_bytes = 0.0;         ///< files of all scenes, a file as often as scenes show it
  double pixels = 0.0;              ///< of all frames
  std::size_t processes = 1;

  /// Whether dealing out tiles takes less processor time.
  bool is_tiles_better() const;
};

}  // namespace tileflight::survey
