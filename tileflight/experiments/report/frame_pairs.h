#pragma once

#include <optional>
#include <vector>

#include "tileflight/experiments/report/run_folder.h"

namespace tileflight::report {

/// Frames of two flights taken from nearly the same pose.
struct FramePair {
  FrameFile first, second;
  std::optional<double> distance_m;  ///< between the cameras, if both poses are known
  std::optional<double> angle_deg;
};

/// At most `count` pairs with the most similar poses (aligned estimates, else true poses), in the order of the first
/// flight. Each frame, with its neighbours, is in one pair only. Frames with very different viewing directions are not
/// paired, so there may be fewer. Without poses, or without any pair, frames at the same fraction of both flights are
/// paired.
std::vector<FramePair> frame_pairs(const FlightRun& first, const FlightRun& second, std::size_t count);

/// `count` frames spread evenly over a flight.
std::vector<FrameFile> pick_evenly(const std::vector<FrameFile>& frames, std::size_t count);

}  // namespace tileflight::report
