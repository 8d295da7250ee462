#pragma once

#include <optional>

#include "tileflight/geometry/transform.h"
#include "tileflight/imaging/image.h"

namespace tileflight::localization {

/// The ground as it looks from straight above (parallel projection), with its heights: a place's, or what a flight saw.
/// In a frame whose z points up: pixel (i, j) shows what lies at `first` + `pixel` (i, -j), so that an image of a local
/// frame is a map with the north on top.
struct GroundImage {
  static constexpr int kHeightStep = 4;  ///< pixels from one height to the next

  imaging::GrayImage grey;     ///< where nothing was seen: a smooth continuation of what was
  imaging::GrayImage seen;     ///< 255 where something was seen, 0 elsewhere
  imaging::FloatImage height;  ///< of pixels (kHeightStep i, kHeightStep j), in the frame's units; NaN: not known
  double pixel = 0.0;          ///< side of a pixel, in the frame's units
  geometry::Vec2 first = geometry::Vec2::Zero();  ///< (x, y) of the first pixel's centre

  geometry::Vec2 position(double i, double j) const { return first + pixel * geometry::Vec2(i, -j); }
  geometry::Vec2 pixel_of(const geometry::Vec2& position) const {
    return {(position.x() - first.x()) / pixel, (first.y() - position.y()) / pixel};
  }
  /// Of the nearest sample; nullopt outside and where it is not known.
  std::optional<double> height_at(const geometry::Vec2& position) const;
};

/// Pixels that were not seen (0 in `seen`) get means of what was seen around them, taken over ever wider squares, so
/// that the rim of what was seen is no edge in the picture.
void fill_unseen(imaging::GrayImage& grey, const imaging::GrayImage& seen);

}  // namespace tileflight::localization
