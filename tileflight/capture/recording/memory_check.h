#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/capture/recording/flight_tiles.h"

namespace tileflight::recording {

/// Throws MemoryLimitExceeded, which says how much memory is needed and what to change, if the tiles of one of these
/// frames do not fit into the limit. Memory is estimated from the files' sizes and a few contents that are read; a
/// frame near the limit is measured. A frame that passes may still turn out too large (PartLoader::load).
void require_frames_fit(FlightTiles& tiles, const std::vector<std::size_t>& frames, std::uintmax_t max_memory_bytes,
                        const Progress& progress);

}  // namespace tileflight::recording
