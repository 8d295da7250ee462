#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>

#include "tileflight/tile_contents/content.h"

namespace tileflight::tile_contents {

/// Information from the container of a glTF.
struct GltfContainerInfo {
  geometry::Vec3 rtc_center = geometry::Vec3::Zero();          ///< of a b3dm (3D Tiles 1.0, "RTC_CENTER")
  std::shared_ptr<const imaging::FeatureTable> features = {};  ///< of its batch table; may be null
};

/// Appends the meshes and points of a glTF 2.0 (its JSON and, from a GLB, its binary chunk) to `out`, in the tile's
/// frame: applies node matrices, then the up-axis rotation, then CESIUM_RTC and the container's centre. Throws
/// InputError.
void append_gltf(std::string_view json, std::span<const std::byte> binary_chunk, const GltfContainerInfo& around,
                 const std::string& name, const ContentOptions& options, DecodedContent& out);

/// Rotation from a glTF's frame to the tile's z-up frame (3D Tiles 1.1, "glTF transforms").
geometry::Mat3 R_tile_gltf(UpAxis up_axis);

}  // namespace tileflight::tile_contents
