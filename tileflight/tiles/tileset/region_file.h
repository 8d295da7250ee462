#pragma once

#include <filesystem>
#include <vector>

#include "tileflight/tiles/tileset/load.h"

namespace tileflight::tileset {

/// Reads the areas of a GeoJSON file (RFC 7946: Polygon and MultiPolygon with their holes, alone or in Features and
/// collections). A Feature's properties `min_height` and `max_height` (metres above the ellipsoid) bound its areas in
/// height. A MultiPolygon that is cut at the antimeridian is joined again; a polygon that crosses it uncut is rejected,
/// as in the RFC. Throws InputError (file, cause).
std::vector<GeographicArea> read_geojson_areas(const std::filesystem::path& file);

/// Sets the areas of `load` to those of all files together, and centre and size to their bounding box. If any area
/// lacks a height, size.z is 0, which means the tileset's whole height. Throws InputError (file, cause).
void set_region_from_geojson(const std::vector<std::filesystem::path>& files, LoadOptions& load);

}  // namespace tileflight::tileset
