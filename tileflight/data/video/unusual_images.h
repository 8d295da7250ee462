#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/data/video/libav.h"

namespace tileflight::video {

/// Returns the width of a pixel as it is shown, divided by its height, as the stream's images are stored; 1 where
/// nothing states it, and where it differs from 1 by less than half a percent, which is the rounding of sizes.
double pixel_aspect_of(AVFormatContext& input, AVStream& stream);

/// Returns what the container says of a stream whose images are not plain ones, and what it means for a calibration and
/// for odometry, a sentence each: turned by a flag, of pixels that are not square, of high dynamic range, interlaced,
/// one of several moving images. `quarter_turns`: clockwise, by the rotation flag.
std::vector<std::string> describe_unusual_images(AVFormatContext& input, AVStream& stream, int quarter_turns);

/// Returns the sentence about interlaced images.
std::string interlaced_text();

/// Returns a sentence about the gaps in the times of images (find_gaps()). Empty: there are none.
std::string describe_gaps(const std::vector<double>& times_s);

}  // namespace tileflight::video
