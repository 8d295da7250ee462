#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/geometry/input_error.h"
#include "tileflight/tiles/content.h"

/// A tile's content of any bytes: b3dm, glb, gltf or cmpt.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  tiles::ContentOptions options;
  options.limits.max_vertices = 1 << 20;
  options.limits.max_triangles = 1 << 20;
  options.limits.max_decompressed_bytes = 1 << 26;
  options.limits.max_texture_pixels = 1 << 20;
  try {
    tiles::decode_content(std::as_bytes(std::span(data, size)), "input", options);
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
