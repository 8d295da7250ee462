#pragma once

#include "tileflight/odometry/odometry.h"

namespace tileflight::odometry {

/// The keyframe in grey with its points on it, coloured by distance from red (near) over yellow and green to blue
/// (far): the paper's figure 1. The colours span the distances between the 5th and the 95th percentile.
imaging::RgbImage debug_picture(const KeyframeView& view);

/// The colour of `share` from 0 (far) to 1 (near).
imaging::Rgb8 depth_color(double share);

}  // namespace tileflight::odometry
