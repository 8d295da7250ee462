#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/imaging/textured_mesh.h"

namespace tileflight::tile_writer {

/// Map position of a mesh's coordinates: coordinate + offset is a position in the reference system.
struct Georeference {
  std::string crs;  ///< PROJ's "EPSG:32717", "EPSG:32717+5773" or WKT, or "ENU:LAT,LON": metres around that place
  geometry::Vec3 offset = geometry::Vec3::Zero();  ///< in units of the reference system
  std::string stated_by;                           ///< source file or option, for messages
};

/// Looks for georeferencing files of photogrammetry programs beside a mesh or in the folder above: OpenDroneMap's
/// odm_georeferencing_model_geo.txt or coords.txt ("WGS84 UTM 17N" and an offset east and north; also in
/// ../odm_georeferencing), or metadata.xml (SRS and SRSOrigin, written by ContextCapture, Metashape, Pix4D and DJI
/// Terra). nullopt if there is none. Throws InputError if one cannot be parsed.
std::optional<Georeference> find_georeference(const std::filesystem::path& mesh_file);

/// A mesh's place on Earth.
struct LocalPlacement {
  geometry::LocalFrame frame;                                           ///< frame at the centre of the mesh's extent
  std::function<geometry::Vec3(const geometry::Vec3&)> local_from_map;  ///< converts its coordinates; for one thread
};

/// Returns the local frame of a mesh of this extent (map coordinates), and the conversion of its vertices to it. Throws
/// InputError like reproject_to_local().
LocalPlacement place_locally(const Georeference& place, const geometry::Box3& extent);

/// Transforms the meshes from map coordinates to an east-north-up frame at the centre of their extent, vertex by
/// vertex, which corrects for the map's scale, grid convergence and the earth's curvature (PROJ). Heights of a system
/// without vertical part are taken as ellipsoidal. Throws InputError for an unknown system or coordinates outside its
/// domain.
geometry::LocalFrame reproject_to_local(const Georeference& place, std::vector<imaging::TexturedMesh>& meshes);

}  // namespace tileflight::tile_writer
