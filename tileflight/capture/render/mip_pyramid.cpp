#include "tileflight/capture/render/mip_pyramid.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <utility>

#include "tileflight/capture/render/linear_color.h"

namespace tileflight::render {
namespace {

constexpr std::size_t kTexelBytes = 3;
constexpr std::size_t kLoadBytes = 8;

/// The source texels that a coarser texel covers along an axis, with their weights.
struct Taps {
  int first = 0;
  int count = 0;
  std::array<float, 3> weight{};
};

/// Box filter from `fine` to `coarse` = ceil(fine / 2) texels: coarse texel i covers [i, i + 1) * fine / coarse.
std::vector<Taps> box_taps(int fine, int coarse) {
  std::vector<Taps> taps(static_cast<std::size_t>(coarse));
  const double scale = static_cast<double>(fine) / coarse;
  for (int i = 0; i < coarse; ++i) {
    Taps& tap = taps[static_cast<std::size_t>(i)];
    const double begin = i * scale;
    const double end = (i + 1) * scale;
    tap.first = static_cast<int>(begin);
    for (int j = tap.first; j < fine && j < end - 1e-9 && tap.count < 3; ++j) {
      const double share = std::min<double>(end, j + 1) - std::max<double>(begin, j);
      tap.weight[static_cast<std::size_t>(tap.count++)] = static_cast<float>(share / scale);
    }
  }
  return taps;
}

struct CoverageAverage {
  LinearRgb covered{};  // weighted sums of light over the covered part
  float covered_share = 0.0F;
  LinearRgb all{};
};

CoverageAverage average(const MipLevel& fine, const imaging::GrayImage& coverage, const Taps& tx, const Taps& ty) {
  const SrgbTables& srgb = SrgbTables::get();
  CoverageAverage sum;
  for (int j = 0; j < ty.count; ++j) {
    const std::size_t row = static_cast<std::size_t>(ty.first + j) * fine.width;
    for (int i = 0; i < tx.count; ++i) {
      const std::size_t index = row + static_cast<std::size_t>(tx.first + i);
      const float weight = tx.weight[i] * ty.weight[j];
      const float covered = coverage.empty() ? weight : weight * (coverage.pixels[index] * (1.0F / 255.0F));
      sum.covered_share += covered;
      for (std::size_t c = 0; c < 3; ++c) {
        const float light = srgb.decode(fine.texels[index * kTexelBytes + c]);
        sum.covered[c] += covered * light;
        sum.all[c] += weight * light;
      }
    }
  }
  return sum;
}

imaging::Rgb8 colour_of(const CoverageAverage& sum) {
  if (sum.covered_share <= 0.0F) return SrgbTables::get().encode(sum.all);
  const float scale = 1.0F / sum.covered_share;
  return SrgbTables::get().encode(LinearRgb{sum.covered[0] * scale, sum.covered[1] * scale, sum.covered[2] * scale});
}

/// Gives uncovered texels the mean colour of their covered neighbours, which bilinear reads at a chart's border reach.
void dilate(imaging::RgbImage& colours, const imaging::GrayImage& coverage) {
  const imaging::RgbImage before = colours;
  for (int y = 0; y < colours.height; ++y) {
    for (int x = 0; x < colours.width; ++x) {
      if (coverage(x, y) != 0) continue;
      std::array<int, 3> sum{};
      int count = 0;
      for (int j = std::max(0, y - 1); j <= std::min(colours.height - 1, y + 1); ++j) {
        for (int i = std::max(0, x - 1); i <= std::min(colours.width - 1, x + 1); ++i) {
          if (coverage(i, j) == 0) continue;
          ++count;
          for (std::size_t c = 0; c < 3; ++c) sum[c] += before(i, j)[c];
        }
      }
      for (std::size_t c = 0; c < 3 && count > 0; ++c) {
        colours(x, y)[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
      }
    }
  }
}

/// Computes the next coarser level; updates `coverage` to that level.
imaging::RgbImage downsample(const MipLevel& fine, imaging::GrayImage& coverage) {
  imaging::RgbImage coarse((fine.width + 1) / 2, (fine.height + 1) / 2);
  imaging::GrayImage coarse_coverage;
  if (!coverage.empty()) coarse_coverage = imaging::GrayImage(coarse.width, coarse.height);
  const std::vector<Taps> columns = box_taps(fine.width, coarse.width);
  const std::vector<Taps> rows = box_taps(fine.height, coarse.height);
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      const CoverageAverage sum =
          average(fine, coverage, columns[static_cast<std::size_t>(x)], rows[static_cast<std::size_t>(y)]);
      coarse(x, y) = colour_of(sum);
      if (coverage.empty() || sum.covered_share <= 0.0F) continue;
      coarse_coverage(x, y) = static_cast<std::uint8_t>(std::clamp(sum.covered_share * 255.0F + 0.5F, 1.0F, 255.0F));
    }
  }
  if (!coverage.empty()) dilate(coarse, coarse_coverage);
  coverage = std::move(coarse_coverage);
  return coarse;
}

std::vector<std::uint8_t> padded_bytes(const imaging::RgbImage& image) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(image.pixels.size() * kTexelBytes + kLoadBytes);
  for (const imaging::Rgb8& texel : image.pixels) bytes.insert(bytes.end(), texel.begin(), texel.end());
  bytes.resize(bytes.size() + kLoadBytes);
  return bytes;
}

}  // namespace

MipPyramid::MipPyramid(std::shared_ptr<const imaging::RgbImage> image, imaging::GrayImage coverage)
    : image_(std::move(image)) {
  static_assert(sizeof(imaging::Rgb8) == kTexelBytes);
  assert(image_ && !image_->empty() && (coverage.empty() || coverage.pixels.size() == image_->pixels.size()));
  const bool long_enough = image_->pixels.size() * kTexelBytes >= kLoadBytes;
  if (coverage.empty() && long_enough) {
    add_level(image_->pixels.data()->data(), image_->width, image_->height);
  } else {
    imaging::RgbImage finest = *image_;
    if (!coverage.empty()) dilate(finest, coverage);
    storage_.push_back(padded_bytes(finest));
    add_level(storage_.back().data(), finest.width, finest.height);
  }
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const imaging::RgbImage coarse = downsample(levels_.back(), coverage);
    storage_.push_back(padded_bytes(coarse));
    add_level(storage_.back().data(), coarse.width, coarse.height);
  }
}

void MipPyramid::add_level(const std::uint8_t* texels, int width, int height) {
  const std::size_t bytes = static_cast<std::size_t>(width) * height * kTexelBytes;
  levels_.push_back({texels, texels + std::max(bytes, kLoadBytes) - kLoadBytes, width, height});
}

imaging::Rgb8 MipPyramid::texel(int i, int x, int y) const {
  const MipLevel& mip = level(i);
  assert(x >= 0 && x < mip.width && y >= 0 && y < mip.height);
  const std::uint8_t* texel = mip.texels + (static_cast<std::size_t>(y) * mip.width + x) * kTexelBytes;
  return {texel[0], texel[1], texel[2]};
}

}  // namespace tileflight::render
