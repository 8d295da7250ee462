#include <cstdlib>
#include <string>

#include "tileflight/live/autopilot/mavlink.h"

namespace {

using namespace tileflight::autopilot;

/// Writes the fields that were read, reads them again, and compares.
void read_again(const MavlinkFrame& frame) {
  const auto first = encode_payload(decode_payload<HilActuatorControls>(frame.payload));
  MavlinkReader reader;
  reader.push(encode_frame(HilActuatorControls::kMessage, {.payload = first}));
  const auto again = reader.next();
  if (!again || encode_payload(decode_payload<HilActuatorControls>(again->payload)) != first) std::abort();
}

}  // namespace

/// The bytes of a connection of PX4, in two pieces.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  MavlinkReader reader;
  for (const std::string_view piece : {bytes.substr(0, size / 2), bytes.substr(size / 2)}) {
    reader.push(piece);
    while (const auto frame = reader.next()) read_again(*frame);
  }
  if (reader.noise_bytes() > size) std::abort();
  return 0;
}
