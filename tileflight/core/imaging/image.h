#pragma once

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tileflight::imaging {

/// A rectangle of an image's pixels: columns from x0 up to, not including, x1, and rows likewise.
struct PixelRegion {
  int x0 = 0, y0 = 0, x1 = 0, y1 = 0;

  int width() const { return x1 - x0; }
  int height() const { return y1 - y0; }
  bool operator==(const PixelRegion&) const = default;
};

using Rgb8 = std::array<std::uint8_t, 3>;  ///< red, green, blue; encoded as in the file (sRGB-like)

/// Pixels in rows from the top, no padding: pixel (x, y) is pixels[y * width + x]; its centre is at (x, y).
template <class Pixel>
struct Image {
  int width = 0;
  int height = 0;
  std::vector<Pixel> pixels;

  Image() = default;
  Image(int w, int h, Pixel fill = Pixel{}) : width(w), height(h), pixels(static_cast<std::size_t>(w) * h, fill) {}

  bool empty() const { return pixels.empty(); }
  Pixel& operator()(int x, int y) {
    assert(x >= 0 && x < width && y >= 0 && y < height);
    return pixels[static_cast<std::size_t>(y) * width + x];
  }
  const Pixel& operator()(int x, int y) const {
    assert(x >= 0 && x < width && y >= 0 && y < height);
    return pixels[static_cast<std::size_t>(y) * width + x];
  }
  Pixel* row(int y) { return pixels.data() + static_cast<std::size_t>(y) * width; }
  const Pixel* row(int y) const { return pixels.data() + static_cast<std::size_t>(y) * width; }
};

using GrayImage = Image<std::uint8_t>;
using Gray16Image = Image<std::uint16_t>;
using RgbImage = Image<Rgb8>;
using FloatImage = Image<float>;

/// Converts to Rec. 601 luma (0.299, 0.587, 0.114), rounded.
GrayImage to_gray(const RgbImage& image);
RgbImage to_rgb(const GrayImage& image);

/// Area-averaged downsampling that matches Camera::scaled_to(width, height). The size must not exceed the image's; at
/// equal size the image is returned unchanged.
FloatImage downsample(const FloatImage& image, int width, int height);

}  // namespace tileflight::imaging
