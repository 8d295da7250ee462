#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/core/geometry/transform.h"

// Division of tiles among processes that each trace all frames against their own tiles, and its cost.
namespace tileflight::recording {

/// A tile and the cost of showing it, in any unit.
struct TileWork {
  geometry::Vec3 center;
  double cost = 0.0;
};

/// The share, from 0 to `shares` - 1, of each tile. The place is cut across its longest side recursively, so that the
/// costs of both sides are proportional to their numbers of cells, up to half a tile's cost per cut. Each share gets
/// several of these cells, one per neighbourhood, so that the tiles in any frame's view are spread over all shares.
std::vector<std::size_t> deal_tiles(const std::vector<TileWork>& tiles, std::size_t shares);

/// In how many scenes a process would show each tile, if it rendered the frames of its range.
using TileUses = std::vector<std::uint32_t>;

std::string to_bytes(const TileUses& uses);
TileUses uses_from_bytes(const std::string& bytes);

/// Amounts that processes would read and exchange under both divisions.
struct SharingCosts {
  double frames_dealt_bytes = 0.0;  ///< files that are read if each process renders a range of frames, all together
  double tiles_dealt_bytes = 0.0;   ///< files that are read if each process has a part of the tiles
  double scene_bytes = 0.0;         ///< files of all scenes, a file as often as scenes show it
  double pixels = 0.0;              ///< of all frames
  std::size_t processes = 1;

  /// Whether dividing the tiles takes less processor time than dividing the frames.
  bool is_tiles_better() const;
};

}  // namespace tileflight::recording
