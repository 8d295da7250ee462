#pragma once

namespace tileflight::mapping {

/// A rolling shutter's line delay, from the images alone (line_delay.h).
struct LineDelayEstimate {
  double line_delay_s = 0.0;  ///< from one row to the next, in the order of play, beyond that which the images were
                              ///< rectified with
  double sigma_s = 0.0;       ///< standard deviation
  int windows = 0;            ///< of the sliding window, from which it comes
};

}  // namespace tileflight::mapping
