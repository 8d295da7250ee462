#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "tileflight/tiles/content.h"

namespace tileflight::tiles {

/// Appends the meshes of a glTF 2.0 (its JSON and, from a GLB, its binary chunk) to `out`, in the tile's frame: node
/// matrices, then the up-axis turn, then CESIUM_RTC and `rtc_center` (b3dm's; 3D Tiles 1.0, "RTC_CENTER"). Throws
/// InputError.
void append_gltf(std::string_view json, std::span<const std::byte> binary_chunk, const geometry::Vec3& rtc_center,
                 const std::string& name, const ContentOptions& options, DecodedContent& out);

/// The turn from a glTF's frame to the tile's z-up frame (3D Tiles 1.1, "glTF transforms").
geometry::Mat3 R_tile_gltf(UpAxis up_axis);

}  // namespace tileflight::tiles
