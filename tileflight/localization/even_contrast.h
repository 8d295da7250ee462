#pragma once

#include "tileflight/imaging/image.h"

namespace tileflight::localization {

/// Grey values about their local mean over the local standard deviation, over a square window of 2 reach + 1 pixels
/// (cut off at the edges), brought to mean 128 and deviation 40: what light, exposure, vignetting and the textures' own
/// tone do over more than the window falls away. `least_deviation`: added to the local one, so that noise on even areas
/// stays small.
imaging::FloatImage with_even_contrast(const imaging::FloatImage& image, int reach, float least_deviation = 4.0F);

}  // namespace tileflight::localization
