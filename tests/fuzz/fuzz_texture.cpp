#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/ktx2.h"

/// A KTX2 texture of any bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const auto bytes = std::as_bytes(std::span(data, size));
  for (const bool is_alpha : {false, true}) {
    try {
      if (is_alpha)
        imaging::decode_ktx2_alpha(bytes, "input", 1 << 18);
      else
        imaging::decode_ktx2(bytes, "input", 1 << 18);
    } catch (const InputError&) {
      // one clear line is what broken input is worth
    }
  }
  return 0;
}
