#include "tileflight/core/drawing/thumbnail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "tileflight/core/imaging/image_files.h"
#include "tileflight/core/drawing/html.h"

namespace tileflight::drawing {
namespace {

constexpr int kJpegQuality = 82;

}  // namespace

imaging::RgbImage downscale(const imaging::RgbImage& image, int width) {
  if (image.width <= width) return image;
  const int height =
      std::max(1, static_cast<int>(std::lround(static_cast<double>(image.height) * width / image.width)));
  imaging::RgbImage result(width, height);
  for (int y = 0; y < height; ++y) {
    const int top = static_cast<int>(std::int64_t{y} * image.height / height);
    const int bottom = std::max(top + 1, static_cast<int>((std::int64_t{y} + 1) * image.height / height));
    for (int x = 0; x < width; ++x) {
      const int left = static_cast<int>(std::int64_t{x} * image.width / width);
      const int right = std::max(left + 1, static_cast<int>((std::int64_t{x} + 1) * image.width / width));
      std::array<int, 3> sum{};
      for (int v = top; v < bottom; ++v) {
        for (int u = left; u < right; ++u) {
          for (std::size_t c = 0; c < 3; ++c) sum[c] += image(u, v)[c];
        }
      }
      const int area = (bottom - top) * (right - left);
      for (std::size_t c = 0; c < 3; ++c) result(x, y)[c] = static_cast<std::uint8_t>((sum[c] + area / 2) / area);
    }
  }
  return result;
}

std::string thumbnail_uri(const std::filesystem::path& image, int width) {
  const std::vector<std::byte> jpeg = imaging::encode_jpeg(downscale(imaging::read_rgb(image), width), kJpegQuality);
  return data_uri("image/jpeg", {reinterpret_cast<const char*>(jpeg.data()), jpeg.size()});
}

}  // namespace tileflight::drawing
