#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/tiles/load.h"

namespace tileflight::tiles {

/// The areas of a GeoJSON file (RFC 7946: Polygon and MultiPolygon with their holes, alone or in Features and
/// collections). A Feature's properties `min_height` and `max_height` (metres above the ellipsoid) bound its areas in
/// height. A MultiPolygon that is cut at the antimeridian is put together again; a polygon that runs across it uncut is
/// refused, as the RFC does. Throws InputError (file, cause).
std::vector<GeographicArea> read_areas(const std::filesystem::path& file);

/// Sets the areas of `load` to those of all files together, and centre and size to the upright box around them. Where
/// not every area has both heights, size.z is 0, which stands for the tileset's whole height. Throws InputError (file,
/// cause).
void set_region_from_geojson(const std::vector<std::filesystem::path>& files, LoadOptions& load);

}  // namespace tileflight::tiles
