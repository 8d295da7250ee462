#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/point_cloud.h"
#include "tileflight/geometry/progress.h"
#include "tileflight/imaging/textured_mesh.h"
#include "tileflight/tiles/open_source.h"
#include "tileflight/tiles/region.h"
#include "tileflight/tiles/viewing.h"

namespace tileflight::tiles {

/// A flight whose pictures a load has to serve (viewing.h).
struct FlightNeed {
  std::vector<Eye> eyes;  ///< local frame; one a picture
  double error_px = 1.0;  ///< a tile may err by so many pixels where the flight is nearest to it
  EyeRange part;          ///< read only what these eyes look at, out of the one cut for all
};

/// What is wanted does not fit into LoadOptions::max_memory_bytes.
class MemoryExceeded : public InputError {
 public:
  using InputError::InputError;
};

/// What part of which place, how fine.
struct LoadOptions {
  /// Where the region is, one of: a geodetic centre, or a local one (tileset that is not georeferenced, or local to
  /// `origin`). A height (z) of NaN means that none was given: the middle of the tileset's own extent is taken.
  std::optional<geometry::Geodetic> center;
  std::optional<geometry::Vec3> center_local;
  /// Metres east, north, up. Without centre and size: the whole tileset if it covers less than 4 km2, else InputError.
  /// An up of 0 or NaN means that none was given: the region is as high as the tileset. A size without a centre lies
  /// about the tileset's middle; a centre without a size is an InputError.
  std::optional<geometry::Vec3> size;
  bool whole_however_large = false;  ///< the whole tileset may cover more than that
  /// Polygons instead of the box: what lies in any of them is wanted, and `center` and `size` only place the frame and
  /// give the heights that an area does not name. They need a frame on the Earth.
  std::vector<GeographicArea> areas;
  /// Geometric error wanted, metres; 0: the finest there is.
  double error_m = 0.0;
  /// Origin of the local frame of a georeferenced tileset; default: the region's centre on the ellipsoid
  /// (height = the region's centre height), else the centre of the root's bounding volume. With a tileset that is not
  /// georeferenced: its frame is taken as the east-north-up frame at this origin (whose height is that of its z = 0).
  std::optional<geometry::Geodetic> origin;
  /// Instead of what a region holds: what a flight looks at, as fine as it sees. No tile is refined beyond `error_m`.
  /// Centre and size then only place the local frame, and are not needed.
  std::optional<FlightNeed> flight;
  /// Missing or broken tiles: false, throw InputError that names the first; true, go on without, `complete` is false.
  bool allow_incomplete = false;
  /// Of what is read, with the trees that rays need (memory_bytes of cut_reader.h). What needs more is a
  /// MemoryExceeded, told before it is all there.
  std::uintmax_t max_memory_bytes = std::numeric_limits<std::uintmax_t>::max();
  /// Read textures (off for ground truth only).
  bool textures = true;
  /// How a source that is named is opened, and whether its terms are accepted.
  SourceOptions source;
  /// What the tiles are for: refused before any is read where the source's terms forbid it.
  std::vector<Use> uses;
};

/// A cut of the tree as meshes in the local frame, and whether it is whole.
struct LoadedTiles {
  std::vector<imaging::TexturedMesh> meshes;  ///< local frame, in the cut's defined order
  std::vector<geometry::PointCloud> clouds;   ///< points that carry no surface, likewise
  std::optional<geometry::LocalFrame>
      local_frame;                ///< nullopt: not georeferenced, local is the tileset's own z-up frame
  Region region;                  ///< in the local frame
  std::int64_t tiles_wanted = 0;  ///< contents of the cut, and parts of the tree that could not be followed
  std::int64_t tiles_loaded = 0;
  std::int64_t tiles_failed = 0;
  std::vector<std::string> failures;  ///< one line a failed tile
  bool complete = false;
  double geometric_error_max_m = 0.0;  ///< largest geometric error in the cut
  std::int64_t triangles = 0;
  std::int64_t points = 0;  ///< of all clouds
  std::int64_t bytes_read = 0;
  std::int64_t cut_size = 0;             ///< contents of the cut that cut_hash names
  std::string cut_hash;                  ///< SHA-256 over the ordered tile identities; of the whole cut for a flight
  std::vector<std::string> attribution;  ///< distinct, most frequent first
  Terms terms;                           ///< of the source
  std::vector<std::string> warnings;     ///< distinct
};

/// Selects and reads the cut that covers the region at the error wanted. Only contents of the cut are read, no
/// ancestors. `source`: as open_source takes it (open_source.h). Throws InputError.
LoadedTiles load_region(const std::string& source, const LoadOptions& options, const Progress& progress = {});
/// The same from any source of bytes; `name` stands in messages.
LoadedTiles load_region(TileSource& source, const std::string& name, const LoadOptions& options,
                        const Progress& progress = {});

}  // namespace tileflight::tiles
