#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/survey/flight_tiles.h"

namespace tileflight::survey {

/// Throws MemoryLimitExceeded, which says how much is needed and what to change, if the tiles of one of these frames
/// need more memory than `max_memory_bytes`: those of the whole frame, or where images may be divided, those of a
/// region that is too small to be divided. Memory is estimated from the files' sizes and a few contents that are read;
/// what is near the limit is measured. A frame that passes may still turn out too large (PartLoader::load).
void require_frames_fit(FlightTiles& tiles, const PlannedFlight& mission, const std::vector<std::size_t>& frames,
                        std::uintmax_t max_memory_bytes, const Progress& progress);

}  // namespace tileflight::survey
