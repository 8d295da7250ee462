#pragma once

#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/experiments/project/recording.h"

namespace tileflight::project {

/// States how a recording's image moves at one moment.
struct MotionSample {
  double time_s = 0.0;
  /// Median displacement of corners between two frames, as a share of the image's width for each second; nullopt: too
  /// few corners could be followed.
  std::optional<double> share_per_s;
};

/// Holds what some frames of a recording show, spread evenly over it.
struct ImageFindings {
  std::vector<MotionSample> motion;   ///< in order of time
  imaging::GrayImage mask;            ///< of find_static_pixels(), full size; empty: nothing stands still
  bool stands_still = false;          ///< the image hardly moves wherever it was looked at
  std::vector<std::string> warnings;  ///< images that show nothing or stand still, damage; a sentence each
};

/// Decodes some 32 pairs of consecutive frames and measures motion and what stands still. Damage
/// behind the first pair is a warning. Throws InputError as video::read_video if the first pair cannot be decoded.
ImageFindings examine_images(const Recording& recording, const Progress& progress = {});

/// States which frames are used, and how the image moves between them.
struct FrameStep {
  int every = 1;
  double share = 0.0;  ///< of the width, by which fast parts move from one frame that is used to the next
};

/// Returns the largest step between frames, at least 1, at which fast parts of the flight (the 90th percentile) move by
/// at most 1 % of the width from frame to frame, and at least 10 frames a second are left. nullopt: no motion is known.
std::optional<FrameStep> choose_frame_step(const std::vector<MotionSample>& motion, double frames_per_second);

}  // namespace tileflight::project
