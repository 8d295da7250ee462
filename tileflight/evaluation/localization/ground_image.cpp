#include "tileflight/evaluation/localization/ground_image.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tileflight::localization {

std::optional<double> GroundImage::height_at(const geometry::Vec2& position) const {
  const geometry::Vec2 p = to_pixel(position) / kHeightStep;
  const double i = std::round(p.x()), j = std::round(p.y());
  if (!(i >= 0.0 && j >= 0.0 && i < height.width && j < height.height)) return std::nullopt;
  const float z = height(static_cast<int>(i), static_cast<int>(j));
  return std::isfinite(z) ? std::optional<double>(z) : std::nullopt;
}

namespace {

/// Means of the seen pixels, and the seen share of each pixel.
struct MaskedMean {
  imaging::FloatImage mean, share;
};

MaskedMean downsample(const MaskedMean& fine) {
  const int width = (fine.mean.width + 1) / 2, height = (fine.mean.height + 1) / 2;
  MaskedMean coarse{imaging::FloatImage(width, height), imaging::FloatImage(width, height)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      float sum = 0.0F, weight = 0.0F;
      for (int dy = 0; dy < 2; ++dy) {
        for (int dx = 0; dx < 2; ++dx) {
          const int i = std::min(2 * x + dx, fine.mean.width - 1), j = std::min(2 * y + dy, fine.mean.height - 1);
          sum += fine.share(i, j) * fine.mean(i, j);
          weight += fine.share(i, j);
        }
      }
      coarse.mean(x, y) = weight > 0.0F ? sum / weight : 0.0F;
      coarse.share(x, y) = std::min(1.0F, weight);
    }
  }
  return coarse;
}

/// Bilinear interpolation of a coarse level at a pixel of the next finer level.
float upsample_bilinear(const imaging::FloatImage& coarse, int x, int y) {
  const float u = std::clamp(0.5F * static_cast<float>(x) - 0.25F, 0.0F, static_cast<float>(coarse.width - 1));
  const float v = std::clamp(0.5F * static_cast<float>(y) - 0.25F, 0.0F, static_cast<float>(coarse.height - 1));
  const int i = static_cast<int>(u), j = static_cast<int>(v);
  const int i1 = std::min(i + 1, coarse.width - 1), j1 = std::min(j + 1, coarse.height - 1);
  const float a = u - static_cast<float>(i), b = v - static_cast<float>(j);
  return (1.0F - b) * ((1.0F - a) * coarse(i, j) + a * coarse(i1, j)) +
         b * ((1.0F - a) * coarse(i, j1) + a * coarse(i1, j1));
}

void fill(MaskedMean& fine, const MaskedMean& coarse) {
  for (int y = 0; y < fine.mean.height; ++y) {
    for (int x = 0; x < fine.mean.width; ++x) {
      const float share = fine.share(x, y);
      if (share < 1.0F)
        fine.mean(x, y) = share * fine.mean(x, y) + (1.0F - share) * upsample_bilinear(coarse.mean, x, y);
    }
  }
}

}  // namespace

void fill_unseen(imaging::GrayImage& grey, const imaging::GrayImage& seen) {
  if (std::ranges::find(seen.pixels, 0) == seen.pixels.end()) return;
  std::vector<MaskedMean> levels(1);
  levels[0].mean = imaging::FloatImage(grey.width, grey.height);
  levels[0].share = imaging::FloatImage(grey.width, grey.height);
  for (std::size_t k = 0; k < grey.pixels.size(); ++k) {
    levels[0].mean.pixels[k] = grey.pixels[k];
    levels[0].share.pixels[k] = seen.pixels[k] != 0 ? 1.0F : 0.0F;
  }
  while (levels.back().mean.width > 1 || levels.back().mean.height > 1) levels.push_back(downsample(levels.back()));
  for (std::size_t k = levels.size() - 1; k-- > 0;) fill(levels[k], levels[k + 1]);
  for (std::size_t k = 0; k < grey.pixels.size(); ++k) {
    if (seen.pixels[k] == 0) grey.pixels[k] = static_cast<std::uint8_t>(std::lround(levels[0].mean.pixels[k]));
  }
}

}  // namespace tileflight::localization
