#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>

#include "tileflight/tiles/tile_content/content.h"

namespace tileflight::tile_content {

/// Decodes a model, given its bytes, name and options, in the tile's z-up frame.
using ModelReader = std::function<DecodedContent(std::span<const std::byte> bytes, const std::string& name,
                                                 const ContentOptions& options)>;

/// Appends every instance of an i3dm tile (3D Tiles 1.0, "Instanced 3D Model") to `out`, in the tile's frame: the model
/// rotated to z-up, then the instance's scale, rotation and position. The model is embedded or referenced by a URI.
/// Throws InputError.
void append_i3dm(std::span<const std::byte> bytes, const std::string& name, const ContentOptions& options,
                 const ModelReader& read_model, DecodedContent& out);

}  // namespace tileflight::tile_content
