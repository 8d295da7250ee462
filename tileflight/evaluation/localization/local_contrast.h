#pragma once

#include "tileflight/core/imaging/image.h"

namespace tileflight::localization {

/// Local contrast normalisation: subtracts the local mean and divides by the local standard deviation over a square
/// window of 2 reach + 1 pixels (clipped at the borders), then scales to mean 128 and standard deviation 40. This
/// removes lighting, exposure, vignetting and texture tone that vary over more than the window. `least_deviation` is
/// added to the local deviation, so that noise in uniform areas stays small.
imaging::FloatImage normalize_local_contrast(const imaging::FloatImage& image, int reach, float least_deviation = 4.0F);

}  // namespace tileflight::localization
