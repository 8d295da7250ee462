#pragma once

#include <filesystem>

#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// Sets centre and size of `load` to the upright box around the areas of a GeoJSON file (RFC 7946: Polygon,
/// MultiPolygon, alone or in Features and collections). Properties `min_height` and `max_height` (metres above the
/// ellipsoid) bound it in height; without them size.z is 0, which stands for the tileset's whole height. Throws
/// InputError (file, cause).
void set_region_from_geojson(const std::filesystem::path& file, tiles::LoadOptions& load);

}  // namespace tileflight::experiment
