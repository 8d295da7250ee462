#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/imaging/textured_mesh.h"

namespace tileflight::tiling {

/// Where a mesh's coordinates lie on a map: coordinate + offset is a place in the reference system.
struct MapPlace {
  std::string crs;  ///< as PROJ takes it ("EPSG:32717", "EPSG:32717+5773", WKT), or "ENU:LAT,LON": metres around there
  geometry::Vec3 offset = geometry::Vec3::Zero();  ///< in the system's units
  std::string stated_by;                           ///< file or option, for messages
};

/// What photogrammetry programs leave beside a mesh or in the folder above it: OpenDroneMap's
/// odm_georeferencing_model_geo.txt or coords.txt ("WGS84 UTM 17N" and an offset east and north; also in
/// ../odm_georeferencing), or metadata.xml (SRS and SRSOrigin, as ContextCapture, Metashape, Pix4D and DJI Terra write
/// it). nullopt where there is none. Throws InputError where one cannot be understood.
std::optional<MapPlace> map_place_beside(const std::filesystem::path& mesh_file);

/// Moves the meshes from the map to an east-north-up frame at the middle of their extent, each vertex by itself, so
/// that the map's scale, its grid's turn from north and the earth's curvature are undone (PROJ). Heights of a system
/// without vertical part are taken to be above the ellipsoid. Throws InputError: an unknown system, coordinates that do
/// not lie in it.
geometry::LocalFrame move_from_map(const MapPlace& place, std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::tiling
