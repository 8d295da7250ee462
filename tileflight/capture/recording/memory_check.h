#pragma once

#include <cstddef>
#include <vector>

#include "tileflight/capture/recording/flight_tiles.h"

namespace tileflight::recording {

/// Bytes that a scene's tiles may take.
struct MemoryLimits {
  double frame = 0.0;  ///< of a whole frame
  double part = 0.0;   ///< of a layer or region, where a frame is divided
};

/// Throws MemoryLimitExceeded, which says how much is needed and what to change, if the tiles of one of these frames
/// need more memory than the limits: those of the whole frame, or where images may be divided, what cannot be divided
/// any more, which is one tile of an image in layers, else the tiles of a region of few pixels. What surrounds the
/// camera does not matter then, since it is looked at apart. Memory is estimated from the files' sizes and a few
/// contents that are read; what is near the limit is measured. A frame that passes may still turn out too large
/// (PartLoader::load).
void require_frames_fit(FlightTiles& tiles, const PlannedFlight& mission, const std::vector<std::size_t>& frames,
                        const MemoryLimits& limits, const Progress& progress);

}  // namespace tileflight::recording
