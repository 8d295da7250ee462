#pragma once

#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::odometry {

/// Draws the keyframe in grey with its points, coloured by distance from red (near) through yellow and green to blue
/// (far), as in figure 1 of the DSO paper. The colour scale spans the 5th to the 95th percentile of distance.
imaging::RgbImage draw_debug_image(const KeyframeView& view);

/// Colour for `share` between 0 (far, blue) and 1 (near, red).
imaging::Rgb8 depth_color(double share);

}  // namespace tileflight::odometry
