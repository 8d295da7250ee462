#pragma once

#include <string>

#include "tileflight/tiles/tile_content/gltf_document.h"

namespace tileflight::tile_content {

/// Throws InputError (name, extension) if a document needs an extension that is not supported; without `textures`,
/// those of images matter not.
void require_supported(const gltf::Document& document, const std::string& name, bool textures);

}  // namespace tileflight::tile_content
