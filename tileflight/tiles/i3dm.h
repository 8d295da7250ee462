#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>

#include "tileflight/tiles/content.h"

namespace tileflight::tiles {

/// Reads a model by itself: its bytes, its name and how it is read, in the tile's z-up frame.
using ReadModel = std::function<DecodedContent(std::span<const std::byte> bytes, const std::string& name,
                                               const ContentOptions& options)>;

/// Appends every instance of an i3dm tile (3D Tiles 1.0, "Instanced 3D Model") to `out`, in the tile's frame: the model
/// turned z-up, then the instance's scale, rotation and position. The model is embedded or lies at a URI. Throws
/// InputError.
void append_i3dm(std::span<const std::byte> bytes, const std::string& name, const ContentOptions& options,
                 const ReadModel& read_model, DecodedContent& out);

}  // namespace tileflight::tiles
