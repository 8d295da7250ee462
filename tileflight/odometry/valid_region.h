#pragma once

// Where the pictures show the scene: not the own body (a mask), not the black surround of a lens's circle or of a
// rectified picture.

#include "tileflight/imaging/image.h"
#include "tileflight/odometry/pyramid.h"

namespace tileflight::odometry {

/// 255 where a pixel and all within reach of a residual's pattern show the scene, else 0. Left out: what `mask` marks
/// (below 128; empty: nothing), and black that joins a corner of the picture, unless that is most of it (a dark
/// picture). Throws InputError when the mask has another size.
imaging::GrayImage valid_region(const imaging::RgbImage& picture, const imaging::GrayImage& mask);

/// Whether black joins the corners over most of the picture, so that it says nothing about the lens.
bool is_dark(const imaging::RgbImage& picture);

/// Takes the rays of pixels outside the region, at every level: no point is chosen there, no corner, no reference
/// pixel.
void keep_region(LensPyramid& lens, const imaging::GrayImage& region);

}  // namespace tileflight::odometry
