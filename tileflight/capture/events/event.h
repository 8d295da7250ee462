#pragma once

#include <cstdint>

namespace tileflight::events {

/// A pixel saw its brightness change by a threshold.
struct Event {
  std::uint32_t t_us = 0;  ///< microseconds since the start of the recording
  std::uint16_t x = 0, y = 0;
  std::uint8_t polarity = 0;  ///< 1: brighter (ON), 0: darker (OFF), as in DSEC

  bool operator==(const Event&) const = default;
};

}  // namespace tileflight::events
