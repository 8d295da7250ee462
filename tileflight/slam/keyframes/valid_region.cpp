#include "tileflight/slam/keyframes/valid_region.h"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::keyframes {
namespace {

using imaging::GrayImage;

constexpr std::uint8_t kInside = 255;
constexpr int kBlack = 6;           ///< grey values; the border around a fisheye's image circle is black but for noise.
                                    ///< Chosen by hand
constexpr double kDarkShare = 0.7;  ///< of the image; chosen by hand
constexpr int kReach_px = 5;        ///< a pattern's reach (2), its gradients' (1), and the edge's own blur
constexpr std::uint8_t kMaskThreshold = 128;

/// 0 in black regions connected to an image corner.
GrayImage mask_black_corners(const imaging::RgbImage& picture) {
  const GrayImage grey = imaging::to_gray(picture);
  const int w = grey.width, h = grey.height;
  GrayImage region(w, h, kInside);
  std::vector<std::pair<int, int>> open;
  const auto visit = [&](int x, int y) {
    if (x < 0 || y < 0 || x >= w || y >= h || region(x, y) == 0 || grey(x, y) > kBlack) return;
    region(x, y) = 0;
    open.emplace_back(x, y);
  };
  for (const int x : {0, w - 1}) {
    for (const int y : {0, h - 1}) visit(x, y);
  }
  while (!open.empty()) {
    const auto [x, y] = open.back();
    open.pop_back();
    visit(x - 1, y), visit(x + 1, y), visit(x, y - 1), visit(x, y + 1);
  }
  return region;
}

bool is_mostly_invalid(const GrayImage& region) {
  const auto outside = std::count(region.pixels.begin(), region.pixels.end(), std::uint8_t{0});
  return static_cast<double>(outside) > kDarkShare * static_cast<double>(region.pixels.size());
}

/// Smallest value within `reach` along rows, then along columns.
GrayImage erode(const GrayImage& region, int reach) {
  GrayImage rows = region;
  for (int y = 0; y < region.height; ++y) {
    for (int x = 0; x < region.width; ++x) {
      const std::uint8_t* begin = region.row(y) + std::max(0, x - reach);
      rows(x, y) = *std::min_element(begin, region.row(y) + std::min(region.width, x + reach + 1));
    }
  }
  GrayImage both = rows;
  for (int y = 0; y < region.height; ++y) {
    for (int yy = std::max(0, y - reach); yy <= std::min(region.height - 1, y + reach); ++yy) {
      std::transform(rows.row(yy), rows.row(yy) + rows.width, both.row(y), both.row(y),
                     [](std::uint8_t a, std::uint8_t b) { return std::min(a, b); });
    }
  }
  return both;
}

/// Halves the region; a pixel is inside if all four are.
GrayImage downsample(const GrayImage& region) {
  GrayImage half(region.width / 2, region.height / 2);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      half(x, y) = std::min(
          {region(2 * x, 2 * y), region(2 * x + 1, 2 * y), region(2 * x, 2 * y + 1), region(2 * x + 1, 2 * y + 1)});
    }
  }
  return half;
}

}  // namespace

bool is_dark(const imaging::RgbImage& picture) { return is_mostly_invalid(mask_black_corners(picture)); }

GrayImage find_valid_region(const imaging::RgbImage& picture, const GrayImage& mask) {
  GrayImage region = mask_black_corners(picture);
  if (is_mostly_invalid(region)) region = GrayImage(picture.width, picture.height, kInside);
  if (mask.empty()) return erode(region, kReach_px);
  if (mask.width != picture.width || mask.height != picture.height) {
    throw InputError("mask", "is " + std::to_string(mask.width) + "x" + std::to_string(mask.height) +
                                 ", the images are " + std::to_string(picture.width) + "x" +
                                 std::to_string(picture.height) + "; draw it at their size");
  }
  for (std::size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i] < kMaskThreshold) region.pixels[i] = 0;
  }
  return erode(region, kReach_px);
}

void mask_rays(LensPyramid& lens, const GrayImage& region) {
  GrayImage level = region;
  for (RayTable& table : lens.rays) {
    for (std::size_t i = 0; i < table.rays.size(); ++i) {
      if (level.pixels[i] == 0) table.rays[i].setZero();
    }
    level = erode(downsample(level), 1);
  }
}

}  // namespace tileflight::keyframes
