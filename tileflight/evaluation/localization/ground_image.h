#pragma once

#include <optional>

#include "tileflight/core/geometry/transform.h"
#include "tileflight/core/imaging/image.h"

namespace tileflight::localization {

/// Orthographic image of the ground from above, with heights: of a place, or of what a flight saw. In a frame with z
/// up, pixel (i, j) shows the position origin + pixel_size (i, -j), so in a local frame north is at the top.
struct GroundImage {
  static constexpr int kHeightStep = 4;  ///< pixels between height samples

  imaging::GrayImage grey;     ///< smoothly extrapolated where nothing was seen
  imaging::GrayImage seen;     ///< 255 where something was seen, 0 elsewhere
  imaging::FloatImage height;  ///< heights at pixels (kHeightStep i, kHeightStep j), in the frame's units; NaN: unknown
  double pixel_size = 0.0;     ///< side of a pixel, in the frame's units
  geometry::Vec2 origin = geometry::Vec2::Zero();  ///< (x, y) of the first pixel's centre

  geometry::Vec2 position(double i, double j) const { return origin + pixel_size * geometry::Vec2(i, -j); }
  geometry::Vec2 to_pixel(const geometry::Vec2& position) const {
    return {(position.x() - origin.x()) / pixel_size, (origin.y() - position.y()) / pixel_size};
  }
  /// Height of the nearest sample; nullopt outside and where it is unknown.
  std::optional<double> height_at(const geometry::Vec2& position) const;
};

/// Fills unseen pixels (0 in `seen`) with means of seen pixels over increasingly large squares, so that the border of
/// the seen area is not an edge in the image.
void fill_unseen(imaging::GrayImage& grey, const imaging::GrayImage& seen);

}  // namespace tileflight::localization
