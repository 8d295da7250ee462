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

/// Holds a moment at which the images do not go on: at a cut, a gap in their times, or images that cannot be read.
struct Break {
  double last_s = 0.0;           ///< time of the last image before
  std::optional<double> next_s;  ///< time of the first image after; nullopt: none of the rest can be read
  std::string what;              ///< a clause that names it
};

/// Holds what some frames of a recording show, spread evenly over it.
struct ImageFindings {
  std::vector<MotionSample> motion;   ///< in order of time
  std::vector<Break> breaks;          ///< in order of time; of a video of fewer than 4000 frames, which is read whole
  int repeats = 1;                    ///< how many times each image is stored, one after the other
  imaging::GrayImage mask;            ///< of find_static_pixels(), full size; empty: nothing stands still
  bool stands_still = false;          ///< the image hardly moves wherever it was looked at
  std::vector<std::string> warnings;  ///< images that show nothing, stand still or repeat, breaks; a sentence each
};

/// Decodes some 32 pairs of frames, each the next that differs, and measures motion, what stands still and what is
/// stored repeatedly; in a video of fewer than 4000 frames it looks for breaks, too. Damage behind the first pair is a
/// warning. Throws InputError as video::read_video if the first pair cannot be decoded.
ImageFindings examine_images(const Recording& recording, const Progress& progress = {});

/// States which frames are used, and how the image moves between them.
struct FrameStep {
  int every = 1;
  double share = 0.0;  ///< of the width, by which fast parts move from one frame that is used to the next
};

/// Returns the largest step between frames, at least 1, at which fast parts of the flight (the 90th percentile) move by
/// at most 1 % of the width from frame to frame, and at least 10 frames a second are left. Of images that are stored
/// `repeats` times, each is taken once at most. nullopt: no motion is known.
std::optional<FrameStep> choose_frame_step(const std::vector<MotionSample>& motion, double frames_per_second,
                                           int repeats = 1);

}  // namespace tileflight::project
