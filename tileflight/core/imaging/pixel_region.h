#pragma once

namespace tileflight::imaging {

/// A rectangle of an image's pixels: columns from x0 up to, not including, x1, and rows likewise.
struct PixelRegion {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool operator==(const PixelRegion&) const = default;
};

/// Copies a region's pixels to another image of the same size; nothing if there are no images.
template <class ImageType>
void copy_region(const PixelRegion& region, const ImageType& from, ImageType& to) {
  if (from.empty()) return;
  for (int y = region.y0; y < region.y1; ++y) {
    for (int x = region.x0; x < region.x1; ++x) to(x, y) = from(x, y);
  }
}

}  // namespace tileflight::imaging
