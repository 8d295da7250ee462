#include <cstdlib>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/autopilot/ardupilot_packet.h"

/// A datagram at an autopilot's UDP port.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  try {
    const auto packet = autopilot::read_servo_packet({reinterpret_cast<const char*>(data), size});
    for (const std::uint16_t pwm : packet.pwm) {
      const double output = autopilot::servo_output(pwm);
      if (!(output >= 0.0 && output <= 1.0)) std::abort();
    }
  } catch (const InputError&) {
    // is reported and ignored
  }
  return 0;
}
