#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "tileflight/tiles/tile_content/content.h"

namespace tileflight::tile_content {

/// Information from the container of a glTF.
struct GltfContainerInfo {
  geometry::Vec3 rtc_center = geometry::Vec3::Zero();  ///< centre that a b3dm states (3D Tiles 1.0, "RTC_CENTER")
  std::shared_ptr<const imaging::FeatureTable> features = {};  ///< batch table of a b3dm; may be null
};

/// Receives the pieces of a glTF one by one, so that they need not all be in memory. Empty functions receive nothing.
struct GltfReceiver {
  /// Decodes an image inside the glTF; may return a stand-in of the same size without pixels.
  std::function<std::shared_ptr<const imaging::RgbImage>(std::span<const std::byte> bytes, const std::string& name)>
      decode_image = {};
  /// Receives each mesh; DecodedContent::meshes then stays empty.
  std::function<void(const imaging::TexturedMesh& mesh)> take_mesh = {};
};

/// Decodes a .glb or .gltf file like decode_content(), and hands the result over piece by piece.
DecodedContent decode_gltf(std::span<const std::byte> bytes, const std::string& name, const ContentOptions& options,
                           const GltfReceiver& receiver);

/// Appends the meshes and points of a glTF 2.0 (its JSON and, from a GLB, its binary chunk) to `out`, in the tile's
/// frame: applies node matrices, then the up-axis rotation, then CESIUM_RTC and the container's centre. Throws
/// InputError.
void append_gltf(std::string_view json, std::span<const std::byte> binary_chunk, const GltfContainerInfo& around,
                 const std::string& name, const ContentOptions& options, DecodedContent& out,
                 const GltfReceiver& receiver = {});

/// Returns the rotation from a glTF's frame to the tile's z-up frame (3D Tiles 1.1, "glTF transforms").
geometry::Mat3 R_tile_gltf(UpAxis up_axis);

}  // namespace tileflight::tile_content
