#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"

/// An image of any bytes: JPEG, PNG, WebP, TIFF, BMP, PGM or PPM.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  try {
    imaging::decode_rgb(std::as_bytes(std::span(data, size)), "input", {1 << 18});
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
