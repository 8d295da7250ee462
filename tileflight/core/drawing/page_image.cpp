#include "tileflight/core/drawing/page_image.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::drawing {

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
  constexpr int kJpegQuality = 82;
  const std::vector<std::byte> jpeg = imaging::encode_jpeg(downscale(imaging::read_rgb(image), width), kJpegQuality);
  return data_uri("image/jpeg", base::as_text(jpeg));
}

std::string encode_png(const PaletteImage& image) {
  return std::string(base::as_text(imaging::encode_png(image.indices, image.palette)));
}

}  // namespace tileflight::drawing
