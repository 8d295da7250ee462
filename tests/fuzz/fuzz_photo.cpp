#include <cstddef>
#include <cstdint>
#include <span>

#include "tileflight/data/flight_logs/photo_log.h"

/// EXIF and XMP of any bytes.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  tileflight::flight_logs::read_photo_tags(std::as_bytes(std::span(data, size)));
  return 0;
}
