#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/load.h"
#include "tileflight/tiles/region.h"
#include "tileflight/tiles/tileset_tree.h"

namespace tileflight::tiles {

/// The local frame of a load, and the region in it.
struct Placement {
  std::optional<geometry::LocalFrame> local_frame;
  geometry::SE3 T_local_tileset;
  Region region;
  std::vector<std::string> warnings;
};

/// Whether a tileset's frame is the Earth's: its root has a geographic region or an S2 cell, or its bounding volume
/// holds the Earth or has its middle within 100 km (and its own radius) of the ellipsoid; unless the tileset itself
/// says that it is not.
bool is_georeferenced(const TilesetTree& tree);

/// From the tileset's frame to the local frame of a tileset that is not georeferenced. That is the tileset's own frame,
/// with one exception: a model without a place that Cesium ion has made "movable" (asset.extras.ion) stands below an
/// empty root in a tile whose transform only says where it was put down, by default with its middle at 0. Coordinates
/// of the survey (its flights, its control points) are those inside that tile, so its transform, if it is a rigid
/// motion, is undone.
geometry::SE3 T_own_tileset(const TilesetTree& tree);

/// "x 0 … 600 m, y …, z …" of a box.
std::string extent_text(const geometry::Box3& box);
/// Where a tileset lies, for a message: in its own frame, or geodetic.
std::string extent_text(const TilesetTree& tree);

/// Where a flight is and where the tileset is that it does not see, both in the local frame, how far apart, and what to
/// do: the end of a message.
std::string apart_text(const geometry::Box3& flown, const geometry::Box3& tileset,
                       const std::optional<geometry::LocalFrame>& frame);

/// Resolves what a user asked for against where the tileset lies (see LoadOptions). Throws InputError.
Placement place(const TilesetTree& tree, const LoadOptions& options, const std::string& source);

}  // namespace tileflight::tiles
