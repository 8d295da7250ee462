#pragma once

// Image region that shows the scene: without the vehicle body (a mask) and without the black border around a fisheye's
// image circle or a rectified image.

#include "tileflight/core/imaging/image.h"
#include "tileflight/slam/keyframes/pyramid.h"

namespace tileflight::keyframes {

/// 255 where a pixel and all pixels within reach of the residual pattern show the scene, else 0. Excluded are pixels
/// below 128 in `mask` (empty: none) and black regions connected to an image corner, unless they cover most of the
/// image (a dark image). Throws InputError if the mask differs in size from the image.
imaging::GrayImage find_valid_region(const imaging::RgbImage& picture, const imaging::GrayImage& mask);

/// Returns whether black connected to the corners covers most of the image, so that the lens border cannot be
/// distinguished from it.
bool is_dark(const imaging::RgbImage& picture);

/// Sets the rays of pixels outside the region to zero at every level, so that no point, corner or reference pixel is
/// selected there.
void mask_rays(LensPyramid& lens, const imaging::GrayImage& region);

}  // namespace tileflight::keyframes
