#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "tileflight/tiles/tile_content/gltf_document.h"
#include "tileflight/tiles/tile_content/json_reader.h"

/// What the JSON of a glTF says of where its numbers lie: buffers, views of them, accessors (glTF 2.0, section 3.6).
/// All throw InputError with `where`: the file and the path inside it.
namespace tileflight::tile_content::gltf {

/// An index into an array of `size` entries, all of which have been read.
std::optional<std::size_t> find_reference(const Json& object, const char* key, std::size_t size,
                                          const std::string& where);

/// The extension of an object; null if it has none of that name.
const Json* find_extension(const Json& object, const char* name, const std::string& where);

Buffer read_buffer(const Json& json, const std::string& where);

/// `document`: its buffers have been read.
BufferView read_view(const Json& json, const Document& document, const std::string& where);

/// `document`: its views have been read.
Accessor read_accessor(const Json& json, const Document& document, const std::string& where);

}  // namespace tileflight::tile_content::gltf
