#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/ktx2.h"

/// A KTX2 texture of any bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  try {
    imaging::decode_ktx2(std::as_bytes(std::span(data, size)), "input", 1 << 18);
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
