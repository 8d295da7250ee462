#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "tileflight/tiles/tile_content/content.h"

namespace tileflight::tile_content {

/// Name of the scalar that holds a point's feature id.
inline constexpr char kFeatureIdScalar[] = "feature_id";

/// Appends the points of a pnts tile (3D Tiles 1.0, "Point Cloud"; 3DTILES_draco_point_compression) to `out`, in the
/// tile's frame. Throws InputError.
void append_pnts(std::span<const std::byte> bytes, const std::string& name, const ContentOptions& options,
                 DecodedContent& out);

}  // namespace tileflight::tile_content
