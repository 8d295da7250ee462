#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tile_content/content.h"

/// A tile's content of any bytes: b3dm, i3dm, pnts, glb, gltf or cmpt.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  // Inside a Draco stream the decoder is the library's alone, and slow on some damage (gltf_geometry.cpp).
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  if (text.find("DRACO") != std::string_view::npos) return 0;
  tile_content::ContentOptions options;
  options.limits.max_vertices = 1 << 20;
  options.limits.max_triangles = 1 << 20;
  options.limits.max_points = 1 << 20;
  options.limits.max_meshes = 1 << 12;
  options.limits.max_decompressed_bytes = 1 << 26;
  options.limits.max_texture_pixels = 1 << 20;
  try {
    tile_content::decode_content(std::as_bytes(std::span(data, size)), "input", options);
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
