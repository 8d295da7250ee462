#include "tileflight/tiles/tile_writer/texture_filter.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace tileflight::tile_writer {
namespace {

/// The source pixels that a target pixel covers along an axis, and their weights (fixed point, sum 2^16).
struct Span {
  int first = 0;
  std::vector<std::uint32_t> weights;
};

std::vector<Span> area_spans(int from, int to) {
  std::vector<Span> spans(static_cast<std::size_t>(to));
  const double ratio = static_cast<double>(from) / to;
  for (int i = 0; i < to; ++i) {
    const double begin = i * ratio, end = std::min<double>((i + 1) * ratio, from);
    Span& span = spans[static_cast<std::size_t>(i)];
    span.first = static_cast<int>(begin);
    std::uint32_t left = 1U << 16;
    for (int p = span.first; p < std::min(from, static_cast<int>(std::ceil(end - 1e-9))); ++p) {
      const double share = (std::min<double>(p + 1, end) - std::max<double>(p, begin)) / (end - begin);
      const auto weight = std::min(left, static_cast<std::uint32_t>(share * 65536.0 + 0.5));
      span.weights.push_back(weight);
      left -= weight;
    }
    span.weights.back() += left;
  }
  return spans;
}

using Sums = std::array<std::uint32_t, 3>;

/// Filters one source row along x: sums scaled by 2^8.
void gather_row(const imaging::Rgb8* row, const std::vector<Span>& spans, std::vector<Sums>& out) {
  for (std::size_t x = 0; x < spans.size(); ++x) {
    Sums sum{};
    for (std::size_t k = 0; k < spans[x].weights.size(); ++k)
      for (std::size_t c = 0; c < 3; ++c)
        sum[c] += spans[x].weights[k] * row[static_cast<std::size_t>(spans[x].first) + k][c];
    for (std::size_t c = 0; c < 3; ++c) out[x][c] = sum[c] >> 8;
  }
}

}  // namespace

imaging::RgbImage resize_area(const imaging::RgbImage& image, int width, int height) {
  const std::vector<Span> across = area_spans(image.width, width), down = area_spans(image.height, height);
  imaging::RgbImage out(width, height);
  std::vector<Sums> row(static_cast<std::size_t>(width));
  std::vector<std::array<std::uint64_t, 3>> sums(static_cast<std::size_t>(width));
  for (int y = 0; y < height; ++y) {
    const Span& span = down[static_cast<std::size_t>(y)];
    std::fill(sums.begin(), sums.end(), std::array<std::uint64_t, 3>{});
    for (std::size_t k = 0; k < span.weights.size(); ++k) {
      gather_row(image.row(span.first + static_cast<int>(k)), across, row);
      for (std::size_t x = 0; x < row.size(); ++x)
        for (std::size_t c = 0; c < 3; ++c) sums[x][c] += static_cast<std::uint64_t>(span.weights[k]) * row[x][c];
    }
    for (std::size_t x = 0; x < row.size(); ++x)
      for (std::size_t c = 0; c < 3; ++c)
        out.row(y)[x][c] = static_cast<std::uint8_t>(std::min<std::uint64_t>(255, (sums[x][c] + (1U << 23)) >> 24));
  }
  return out;
}

imaging::RgbImage blur_binomial(const imaging::RgbImage& image) {
  imaging::RgbImage out(image.width, image.height);
  const auto column = [&](int x, int y0, int y1, int y2, std::size_t c) {
    const int at = std::clamp(x, 0, image.width - 1);
    return image.row(y0)[at][c] + 2 * image.row(y1)[at][c] + image.row(y2)[at][c];
  };
  for (int y = 0; y < image.height; ++y) {
    const int above = std::max(0, y - 1), below = std::min(image.height - 1, y + 1);
    for (int x = 0; x < image.width; ++x)
      for (std::size_t c = 0; c < 3; ++c) {
        const int sum =
            column(x - 1, above, y, below, c) + 2 * column(x, above, y, below, c) + column(x + 1, above, y, below, c);
        out(x, y)[c] = static_cast<std::uint8_t>((sum + 8) / 16);
      }
  }
  return out;
}

}  // namespace tileflight::tile_writer
