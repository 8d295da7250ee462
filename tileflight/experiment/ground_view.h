#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/experiment/open_place.h"
#include "tileflight/report/place_map.h"
#include "tileflight/sensors/top_down.h"

namespace tileflight::experiment {

/// A place from straight above, as far as its tiles go.
struct GroundView {
  sensors::GroundGrid grid;
  sensors::TopDown image;
  std::vector<MissingTile> missing;
  std::int64_t tiles = 0;
  std::int64_t parts = 0;   ///< the picture was painted in so many, one after the other
  double error_m = 0.0;     ///< geometric error that was asked for
  bool is_coarser = false;  ///< somewhere memory wanted coarser tiles than that
};

struct GroundViewOptions {
  double error_m = 0.0;              ///< geometric error wanted
  sensors::TopDownOptions top_down;  ///< what heights count
  std::uintmax_t max_memory_bytes = 0;
};

/// Looks down on the region of `place` within the grid. Where the tiles of a part take more memory than there is, it is
/// painted in quarters, and a part that is small already from coarser tiles, so that a city takes as much memory as a
/// yard does. Throws InputError (tiles::MemoryExceeded) where not even that fits.
GroundView look_down(OpenPlace& place, const sensors::GroundGrid& grid, const GroundViewOptions& options,
                     const Progress& progress);

/// The box about all surfaces and points of a region, by tiles whose geometric error is at most `error_m`; empty where
/// there is none. Tiles' bounding volumes are often much larger than what is in them.
geometry::Box3 surface_bounds(OpenPlace& place, double error_m, std::uintmax_t max_memory_bytes,
                              const Progress& progress);

/// A grid over a box of the ground with so many pixels along its longer side, square ones; the shorter side is at least
/// a third of it.
sensors::GroundGrid grid_over(const geometry::Box3& box, int pixels);

/// As the report draws it: the view's extent, colours, heights and missing tiles.
report::GroundPicture picture_of(const GroundView& view);
std::vector<report::MapOutline> missing_outlines(const GroundView& view);

/// Lowest and highest surface; nullopt where there is none.
std::optional<std::pair<double, double>> height_range(const imaging::FloatImage& heights_m);

/// The view's notes for people: missing tiles, coarser ones.
std::vector<std::string> warnings_of(const GroundView& view);

}  // namespace tileflight::experiment
