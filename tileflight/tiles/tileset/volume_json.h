#pragma once

#include <optional>
#include <string>

#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tileset/bounding_volume.h"

namespace tileflight::tileset {

/// Reads a tile's or content's volume (3D Tiles 1.1, "Bounding Volumes"; the extensions for S2 cells and cylinders).
/// nullopt if there is none of a known kind. Throws InputError.
std::optional<BoundingVolume> parse_volume(const tile_content::Json& parent, const std::string& where,
                                           const char* key = "boundingVolume");

}  // namespace tileflight::tileset
