#pragma once

#include "tileflight/capture/preview/previewed_flight.h"

namespace tileflight::preview {

/// Tiles along a flight's path, against which it is checked.
struct SurroundingTiles {
  place::PlacePart part;    ///< without textures
  bool is_coarser = false;  ///< than half a percent of their distance, or less far around, for lack of memory
};

/// Reads tiles with an error of at most half a percent of their distance from the path; the first coarser level that
/// fits, where they need more than half of the memory. Throws tileset::MemoryLimitExceeded if none does.
SurroundingTiles read_surroundings(PreviewedFlight& flight, const Progress& progress);

}  // namespace tileflight::preview
