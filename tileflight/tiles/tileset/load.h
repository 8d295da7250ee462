#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/core/imaging/textured_mesh.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/region.h"
#include "tileflight/tiles/tileset/view_criteria.h"

namespace tileflight::tileset {

/// A flight whose images a loaded scene must support (view_criteria.h).
struct FlightSelection {
  std::vector<ViewCone> view_cones;  ///< local frame; one per image
  double error_px = 1.0;             ///< allowed error of a tile, pixels, where the flight is nearest to it
};

/// The selected contents do not fit into LoadOptions::max_memory_bytes.
class MemoryLimitExceeded : public InputError {
 public:
  using InputError::InputError;
};

/// Which part of which site to load, at which level of detail.
struct LoadOptions {
  /// Centre of the region, either geodetic or local (for a tileset that is not georeferenced, or relative to `origin`).
  /// A height (z) of NaN means unspecified: the centre of the tileset's extent is used.
  std::optional<geometry::Geodetic> center;
  std::optional<geometry::Vec3> center_local;
  /// Metres east, north, up. Without centre and size: the whole tileset if it covers less than 4 km2, otherwise
  /// InputError. An up of 0 or NaN means unspecified: the region has the tileset's height. A size without a centre is
  /// placed at the tileset's centre; a centre without a size is an InputError.
  std::optional<geometry::Vec3> size;
  bool allow_large_area = false;  ///< the whole tileset may exceed that limit
  /// Polygons instead of the box: the region is their union; `center` and `size` only place the frame and give heights
  /// that an area does not state. Requires a georeferenced frame.
  std::vector<GeographicArea> areas;
  /// Requested geometric error, metres; 0: the finest level.
  double error_m = 0.0;
  /// Origin of the local frame of a georeferenced tileset; default: the region's centre on the ellipsoid (height = the
  /// region's centre height), else the centre of the root's bounding volume. For a tileset that is not georeferenced:
  /// its frame is taken as the east-north-up frame at this origin (whose height is that of its z = 0).
  std::optional<geometry::Geodetic> origin;
  /// Instead of a region: selects what a flight sees, at the resolution it needs. No tile is refined beyond `error_m`.
  /// Centre and size then only place the local frame, and are optional.
  std::optional<FlightSelection> flight;
  /// Missing or broken tiles: false, throw InputError for the first; true, continue without them, `complete` is false.
  bool allow_incomplete = false;
  /// Memory limit for loaded contents, including acceleration structures (memory_bytes of cut_reader.h). Throws
  /// MemoryLimitExceeded before everything is read.
  std::uintmax_t max_memory_bytes = std::numeric_limits<std::uintmax_t>::max();
  /// False: textures are not read. Ground truth does not need them.
  bool textures = true;
  /// Options for opening the source; they state whether its terms are accepted.
  fetch::SourceOptions source;
  /// Intended uses of the tiles. If the source's terms forbid one, no tile is read.
  std::vector<fetch::Use> uses;
};

/// A cut of the tree as meshes in the local frame, and whether it is complete.
struct LoadedTiles {
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame, in the order of the cut
  std::vector<geometry::PointCloud> clouds;   ///< points without surface, in the local frame
  std::optional<geometry::LocalFrame>
      local_frame;                ///< nullopt: not georeferenced; local is the tileset's own z-up frame
  Region region;                  ///< in the local frame
  std::int64_t tiles_wanted = 0;  ///< contents of the cut, and parts of the tree that could not be followed
  std::int64_t tiles_loaded = 0;
  std::int64_t tiles_failed = 0;
  std::vector<std::string> failures;  ///< one line per failed tile
  bool complete = false;
  double geometric_error_max_m = 0.0;  ///< largest geometric error in the cut
  std::int64_t triangles = 0;
  std::int64_t points = 0;  ///< points of all clouds
  std::int64_t bytes_read = 0;
  std::int64_t cut_size = 0;             ///< number of contents covered by cut_hash
  std::string cut_hash;                  ///< SHA-256 over the ordered tile identities; for a flight, of the whole cut
  std::vector<std::string> attribution;  ///< distinct, most frequent first
  fetch::TermsOfUse terms;               ///< terms of the source
  std::vector<std::string> warnings;     ///< distinct
};

/// Selects and reads the cut that covers the region at the requested error. Only contents of the cut are read, not
/// those of ancestors. `source`: a SOURCE of open_source(). Throws InputError.
LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress = {});
/// Loads a region like the function above, from any byte source. `name` is used in messages.
LoadedTiles load_region(fetch::TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress = {});

}  // namespace tileflight::tileset
