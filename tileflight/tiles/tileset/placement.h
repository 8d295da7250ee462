#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/load.h"
#include "tileflight/tiles/tileset/region.h"
#include "tileflight/tiles/tileset/tileset_tree.h"

namespace tileflight::tileset {

/// The local frame of a loaded tileset, and the region in it.
struct Placement {
  std::optional<geometry::LocalFrame> local_frame;
  geometry::SE3 T_local_tileset;
  Region region;
  std::vector<std::string> warnings;
};

/// Returns whether a tileset's frame is earth-centred: its root has a geographic region or an S2 cell, or its bounding
/// volume contains the Earth or is centred within 100 km (plus its own radius) of the ellipsoid. What the tileset
/// itself states takes precedence.
bool is_georeferenced(const TilesetTree& tree);

/// Returns the transform from the tileset's frame to the local frame of a tileset that is not georeferenced. This is
/// the identity, with one exception: Cesium ion places an unlocated model marked "movable" (asset.extras.ion) below an
/// empty root, in a tile whose transform is an arbitrary placement, by default with its centre at 0. Survey coordinates
/// (flights, control points) refer to the frame inside that tile, so its transform, if rigid, is undone.
geometry::SE3 T_own_tileset(const TilesetTree& tree);

/// Describes a box: "x 0 … 600 m, y …, z …".
std::string describe_extent(const geometry::Box3& box);
/// Describes the extent of a tileset for messages, in its own frame or in geodetic coordinates.
std::string describe_extent(const TilesetTree& tree);

/// Returns the end of a message about a flight that does not see the tileset: the positions of both in the local frame,
/// their distance, and what to do.
std::string describe_separation(const geometry::Box3& flown, const geometry::Box3& tileset,
                                const std::optional<geometry::LocalFrame>& frame);

/// Resolves the requested region against the tileset's extent (see LoadOptions). Throws InputError.
Placement resolve_placement(const TilesetTree& tree, const LoadOptions& options, const std::string& source);

}  // namespace tileflight::tileset
