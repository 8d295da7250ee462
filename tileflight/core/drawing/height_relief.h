#pragma once

#include "tileflight/core/imaging/image.h"

namespace tileflight::drawing {

/// The map's colour of a height, given as a fraction 0 to 1 of the displayed range.
imaging::Rgb8 height_color(double share);

/// Hill shading with light from the north-west, relative to flat ground (1); NaN where there is no surface.
imaging::FloatImage hill_shade(const imaging::FloatImage& heights_m, double pixel_m);

}  // namespace tileflight::drawing
