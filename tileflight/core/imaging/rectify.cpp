#include "tileflight/core/imaging/rectify.h"

#include <cmath>

namespace tileflight::imaging {

namespace {

constexpr std::array<float, 2> kUnseen{-1.0F, -1.0F};

/// Weights of the four pixels around a point in the image, and the first of them.
struct BilinearWeights {
  int x = 0, y = 0;
  float right = 0.0F, down = 0.0F;
};

BilinearWeights corners_of(const std::array<float, 2>& at, int width, int height) {
  BilinearWeights c{static_cast<int>(at[0]), static_cast<int>(at[1])};
  if (c.x == width - 1 && c.x > 0) --c.x;
  if (c.y == height - 1 && c.y > 0) --c.y;
  c.right = at[0] - static_cast<float>(c.x);
  c.down = at[1] - static_cast<float>(c.y);
  return c;
}

/// `channel` extracts one channel of a pixel.
template <class Pixel, class Channel>
float interpolate_channel(const Image<Pixel>& image, const BilinearWeights& c, const Channel& channel) {
  const int x1 = std::min(c.x + 1, image.width - 1), y1 = std::min(c.y + 1, image.height - 1);
  const float top = channel(image(c.x, c.y)) * (1.0F - c.right) + channel(image(x1, c.y)) * c.right;
  const float bottom = channel(image(c.x, y1)) * (1.0F - c.right) + channel(image(x1, y1)) * c.right;
  return top * (1.0F - c.down) + bottom * c.down;
}

std::uint8_t rounded(float value) { return static_cast<std::uint8_t>(std::lround(value)); }

template <class Pixel, class Blend>
Image<Pixel> resample_image(const Image<Pixel>& picture, const Image<std::array<float, 2>>& source,
                            const Blend& blend) {
  Image<Pixel> out(source.width, source.height);
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    if (source.pixels[i][0] < 0.0F) continue;
    out.pixels[i] = blend(corners_of(source.pixels[i], picture.width, picture.height));
  }
  return out;
}

}  // namespace

Rectifier::Rectifier(const Camera& from, const Camera& to)
    : from_(from), to_(to), source_(to.width(), to.height(), kUnseen) {
  for (int y = 0; y < to.height(); ++y) {
    for (int x = 0; x < to.width(); ++x) {
      const auto ray = to.unproject({x, y});
      const auto pixel = ray ? from.project(*ray) : std::nullopt;
      const bool seen = pixel && pixel->x() >= 0.0 && pixel->y() >= 0.0 && pixel->x() <= from.width() - 1.0 &&
                        pixel->y() <= from.height() - 1.0;
      if (seen) source_(x, y) = {static_cast<float>(pixel->x()), static_cast<float>(pixel->y())};
    }
  }
}

RgbImage Rectifier::operator()(const RgbImage& picture) const {
  assert(picture.width == from_.width() && picture.height == from_.height());
  return resample_image(picture, source_, [&](const BilinearWeights& c) {
    Rgb8 out{};
    for (int k = 0; k < 3; ++k) {
      out[k] = rounded(interpolate_channel(picture, c, [k](const Rgb8& p) { return static_cast<float>(p[k]); }));
    }
    return out;
  });
}

GrayImage Rectifier::operator()(const GrayImage& picture) const {
  assert(picture.width == from_.width() && picture.height == from_.height());
  return resample_image(picture, source_, [&](const BilinearWeights& c) {
    return rounded(interpolate_channel(picture, c, [](std::uint8_t p) { return static_cast<float>(p); }));
  });
}

FloatImage Rectifier::operator()(const FloatImage& picture) const {
  assert(picture.width == from_.width() && picture.height == from_.height());
  return resample_image(picture, source_, [&](const BilinearWeights& c) {
    return interpolate_channel(picture, c, [](float p) { return p; });
  });
}

}  // namespace tileflight::imaging
