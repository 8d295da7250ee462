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

/// Whether a tileset's frame is earth-centred: its root has a geographic region or an S2 cell, or its bounding volume
/// contains the Earth or is centred within 100 km (plus its own radius) of the ellipsoid; unless the tileset itself
/// states otherwise.
bool is_georeferenced(const TilesetTree& tree);

/// Transform from the tileset's frame to the local frame of a tileset that is not georeferenced. This is the identity,
/// with one exception: Cesium ion places an unlocated model marked "movable" (asset.extras.ion) below an empty root, in
/// a tile whose transform is an arbitrary placement, by default with its centre at 0. Survey coordinates (flights,
/// control points) refer to the frame inside that tile, so its transform, if rigid, is undone.
geometry::SE3 T_own_tileset(const TilesetTree& tree);

/// Text "x 0 … 600 m, y …, z …" for a box.
std::string describe_extent(const geometry::Box3& box);
/// Extent of a tileset for messages: in its own frame, or geodetic.
std::string describe_extent(const TilesetTree& tree);

/// Positions, in the local frame, of a flight and of the tileset that it does not see, their distance, and what to do:
/// the end of a message.
std::string describe_separation(const geometry::Box3& flown, const geometry::Box3& tileset,
                                const std::optional<geometry::LocalFrame>& frame);

/// Resolves the requested region against the tileset's extent (see LoadOptions). Throws InputError.
Placement resolve_placement(const TilesetTree& tree, const LoadOptions& options, const std::string& source);

}  // namespace tileflight::tileset
