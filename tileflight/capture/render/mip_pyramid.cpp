#include "tileflight/capture/render/mip_pyramid.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cstring>
#include <utility>

#include "tileflight/capture/render/linear_color.h"
#include "tileflight/core/base/simd.h"
#include "tileflight/core/imaging/deferred_texture.h"

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

/// The weights of the covered texels, or of all, and the light summed by them.
struct LightSum {
  base::Float4 light{};
  float share = 0.0F;
};

/// `columns`, `rows`: the taps' counts, constants for the loops of the usual size.
template <bool kCoveredOnly>
TILEFLIGHT_LANE_INLINE LightSum sum_light(const SrgbTables& srgb, const MipLevel& fine, const std::uint8_t* coverage,
                                          const Taps& tx, const Taps& ty, int columns, int rows) {
  LightSum sum;
  for (int j = 0; j < rows; ++j) {
    const std::size_t row = static_cast<std::size_t>(ty.first + j) * static_cast<std::size_t>(fine.width);
    for (int i = 0; i < columns; ++i) {
      const std::size_t index = row + static_cast<std::size_t>(tx.first + i);
      float weight = tx.weight[static_cast<std::size_t>(i)] * ty.weight[static_cast<std::size_t>(j)];
      if constexpr (kCoveredOnly) weight *= static_cast<float>(coverage[index]) * (1.0F / 255.0F);
      const std::uint8_t* texel = fine.texels + index * kTexelBytes;
      sum.share += weight;
      sum.light += weight * base::Float4{srgb.decode(texel[0]), srgb.decode(texel[1]), srgb.decode(texel[2]), 0.0F};
    }
  }
  return sum;
}

template <bool kCoveredOnly>
LightSum sum_light(const SrgbTables& srgb, const MipLevel& fine, const std::uint8_t* coverage, const Taps& tx,
                   const Taps& ty) {
  if (tx.count == 2 && ty.count == 2) return sum_light<kCoveredOnly>(srgb, fine, coverage, tx, ty, 2, 2);
  return sum_light<kCoveredOnly>(srgb, fine, coverage, tx, ty, tx.count, ty.count);
}

/// Gives uncovered texels the mean colour of their covered neighbours, which bilinear reads at a chart's border reach.
void dilate(std::uint8_t* texels, const imaging::GrayImage& coverage) {
  const auto width = static_cast<std::size_t>(coverage.width);
  const auto is_border = [&](const std::uint8_t* above, const std::uint8_t* row, const std::uint8_t* below,
                             std::vector<std::uint8_t>& columns, std::vector<std::uint8_t>& border) {
    for (std::size_t x = 0; x < width; ++x) columns[x + 1] = above[x] | row[x] | below[x];
    for (std::size_t x = 0; x < width; ++x) {
      const auto near = static_cast<std::uint8_t>(columns[x] | columns[x + 1] | columns[x + 2]);
      border[x] = static_cast<std::uint8_t>(row[x] == 0 ? near != 0 : 0);
    }
  };
  std::vector<std::uint8_t> columns(width + 2), border(width);
  for (int y = 0; y < coverage.height; ++y) {
    const std::uint8_t* row = coverage.row(y);
    if (std::memchr(row, 0, width) == nullptr) continue;
    const int top = std::max(0, y - 1), bottom = std::min(coverage.height - 1, y + 1);
    is_border(coverage.row(top), row, coverage.row(bottom), columns, border);
    for (std::size_t next = 0; next < width; ++next) {
      const void* found = std::memchr(border.data() + next, 1, width - next);
      if (found == nullptr) break;
      next = static_cast<std::size_t>(static_cast<const std::uint8_t*>(found) - border.data());
      const auto x = static_cast<int>(next);
      std::array<int, 3> sum{};
      int count = 0;
      for (int j = top; j <= bottom; ++j) {
        for (int i = std::max(0, x - 1); i <= std::min(coverage.width - 1, x + 1); ++i) {
          if (coverage(i, j) == 0) continue;
          const std::uint8_t* texel = texels + (static_cast<std::size_t>(j) * width + static_cast<std::size_t>(i)) * 3;
          ++count;
          for (std::size_t c = 0; c < 3; ++c) sum[c] += texel[c];
        }
      }
      // Only covered texels are read, and only uncovered ones are written.
      std::uint8_t* texel = texels + (static_cast<std::size_t>(y) * width + next) * kTexelBytes;
      for (std::size_t c = 0; c < 3; ++c) texel[c] = static_cast<std::uint8_t>((sum[c] + count / 2) / count);
    }
  }
}

std::vector<std::uint8_t> padded_storage(int width, int height) {
  return std::vector<std::uint8_t>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height) * kTexelBytes +
                                   kLoadBytes);
}

/// Computes the texels of the next coarser level; updates `coverage` to that level.
std::vector<std::uint8_t> downsample(const MipLevel& fine, imaging::GrayImage& coverage) {
  const int width = (fine.width + 1) / 2, height = (fine.height + 1) / 2;
  std::vector<std::uint8_t> coarse = padded_storage(width, height);
  imaging::GrayImage coarse_coverage;
  if (!coverage.empty()) coarse_coverage = imaging::GrayImage(width, height);
  const std::vector<Taps> columns = box_taps(fine.width, width);
  const std::vector<Taps> rows = box_taps(fine.height, height);
  const SrgbTables& srgb = SrgbTables::get();
  std::uint8_t* texel = coarse.data();
  for (int y = 0; y < height; ++y) {
    const Taps& ty = rows[static_cast<std::size_t>(y)];
    for (int x = 0; x < width; ++x, texel += kTexelBytes) {
      const Taps& tx = columns[static_cast<std::size_t>(x)];
      LightSum sum;
      if (!coverage.empty()) {
        sum = sum_light<true>(srgb, fine, coverage.pixels.data(), tx, ty);
        if (sum.share > 0.0F) {
          coarse_coverage(x, y) = static_cast<std::uint8_t>(std::clamp(sum.share * 255.0F + 0.5F, 1.0F, 255.0F));
        } else {
          sum = {sum_light<false>(srgb, fine, nullptr, tx, ty).light, 1.0F};
        }
      } else {
        sum = sum_light<false>(srgb, fine, nullptr, tx, ty);
      }
      const base::Float4 mean = sum.light * (1.0F / sum.share);
      const imaging::Rgb8 colour = srgb.encode(LinearRgb{mean[0], mean[1], mean[2]});
      std::memcpy(texel, colour.data(), kTexelBytes);
    }
  }
  if (!coverage.empty()) dilate(coarse.data(), coarse_coverage);
  coverage = std::move(coarse_coverage);
  return coarse;
}

}  // namespace

MipPyramid::MipPyramid(std::shared_ptr<const imaging::RgbImage> image, std::function<imaging::GrayImage()> coverage)
    : image_(std::move(image)), coverage_(std::move(coverage)) {
  assert(image_ && (!image_->empty() || imaging::is_deferred(image_)));
  for (int longest = std::max(image_->width, image_->height); longest > 1; longest = (longest + 1) / 2) ++level_count_;
}

// It has no parallel loops: a thread that waits for them could take up a pixel that waits for this texture.
const MipLevel* MipPyramid::build() const {
  std::call_once(once_, [this] { compute_levels(); });
  return first_level_.load(std::memory_order_acquire);
}

void MipPyramid::compute_levels() const {
  static_assert(sizeof(imaging::Rgb8) == kTexelBytes);
  imaging::GrayImage coverage = coverage_ ? coverage_() : imaging::GrayImage();
  std::shared_ptr<const imaging::RgbImage> image = imaging::with_pixels(image_);  // a deferred one is decoded here
  const bool is_held = image == image_;
  assert(coverage.empty() || coverage.pixels.size() == image->pixels.size());
  const bool long_enough = image->pixels.size() * kTexelBytes >= kLoadBytes;
  if (coverage.empty() && long_enough && is_held) {
    add_level(image->pixels.data()->data(), image->width, image->height);
  } else {
    storage_.push_back(padded_storage(image->width, image->height));
    std::memcpy(storage_.back().data(), image->pixels.data(), image->pixels.size() * kTexelBytes);
    image.reset();
    if (!coverage.empty()) dilate(storage_.back().data(), coverage);
    add_level(storage_.back().data(), image_->width, image_->height);
  }
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const MipLevel& fine = levels_.back();
    storage_.push_back(downsample(fine, coverage));
    add_level(storage_.back().data(), (fine.width + 1) / 2, (fine.height + 1) / 2);
  }
  assert(levels() == static_cast<int>(levels_.size()));
  first_level_.store(levels_.data(), std::memory_order_release);
}

void MipPyramid::add_level(const std::uint8_t* texels, int width, int height) const {
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
