#include "tileflight/slam/keyframes/pixel_selector.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

namespace tileflight::keyframes {
namespace {

constexpr int kRegion = 32;                ///< edge of a region with a common threshold, pixels; 32 and the mean over
                                           ///< 3x3 regions as in DSO's implementation
constexpr float kScaleDownweight = 0.75F;  ///< factor on the gradient threshold per coarser scale. In DSO's
                                           ///< implementation 0.75 and 0.75^3 are factors on the squared threshold
constexpr int kHistogramBins = 64;         ///< each one grey value per pixel wide; the last one takes all above

/// Squared gradient threshold of each region, row by row.
struct Thresholds {
  int columns = 0;
  int rows = 0;
  std::vector<float> squared;

  float at(int x, int y) const {
    return squared[static_cast<std::size_t>(std::min(y / kRegion, rows - 1)) * columns +
                   std::min(x / kRegion, columns - 1)];
  }
  /// The lowest of a block of pixels, x1 and y1 exclusive.
  float lowest(int x0, int y0, int x1, int y1) const {
    float least = at(x0, y0);
    for (int y = y0 / kRegion * kRegion; y < y1; y += kRegion) {
      for (int x = x0 / kRegion * kRegion; x < x1; x += kRegion) least = std::min(least, at(x, y));
    }
    return least;
  }
};

/// Squared gradients of one level; zero on the border.
struct GradientMap {
  int width = 0;
  int height = 0;
  std::vector<float> squared;

  float at(int x, int y) const { return squared[static_cast<std::size_t>(y) * width + x]; }
};

GradientMap gradient_map(const PyramidLevel& level) {
  constexpr int kRowsPerTask = 32;
  GradientMap map{level.width, level.height, std::vector<float>(static_cast<std::size_t>(level.width) * level.height)};
  tbb::parallel_for(tbb::blocked_range<int>(1, std::max(1, level.height - 1), kRowsPerTask), [&](const auto& range) {
    for (int y = range.begin(); y < range.end(); ++y) {
      float* out = map.squared.data() + static_cast<std::size_t>(y) * map.width;
      for (int x = 1; x < level.width - 1; ++x) out[x] = level.gradient_squared(x, y);
    }
  });
  return map;
}

float median_gradient(const GradientMap& level, int x0, int y0) {
  std::array<int, kHistogramBins> histogram{};
  int total = 0;
  const int x1 = std::min(x0 + kRegion, level.width - 1), y1 = std::min(y0 + kRegion, level.height - 1);
  for (int y = std::max(y0, 1); y < y1; ++y) {
    for (int x = std::max(x0, 1); x < x1; ++x, ++total) {
      const int bin = static_cast<int>(std::sqrt(level.at(x, y)));
      ++histogram[std::min(bin, kHistogramBins - 1)];
    }
  }
  int below = 0, bin = 0;
  while (bin < kHistogramBins - 1 && (below += histogram[bin]) * 2 < total) ++bin;
  return static_cast<float>(bin);
}

Thresholds region_thresholds(const GradientMap& level, float min_gradient) {
  Thresholds t;
  t.columns = std::max(1, level.width / kRegion);
  t.rows = std::max(1, level.height / kRegion);
  std::vector<float> raw(static_cast<std::size_t>(t.columns) * t.rows);
  for (int r = 0; r < t.rows; ++r) {
    for (int c = 0; c < t.columns; ++c) {
      raw[static_cast<std::size_t>(r) * t.columns + c] =
          median_gradient(level, c * kRegion, r * kRegion) + min_gradient;
    }
  }
  t.squared.resize(raw.size());
  for (int r = 0; r < t.rows; ++r) {
    for (int c = 0; c < t.columns; ++c) {
      float sum = 0;
      int count = 0;
      for (int rr = std::max(0, r - 1); rr <= std::min(t.rows - 1, r + 1); ++rr) {
        for (int cc = std::max(0, c - 1); cc <= std::min(t.columns - 1, c + 1); ++cc, ++count) {
          sum += raw[static_cast<std::size_t>(rr) * t.columns + cc];
        }
      }
      const float mean = sum / static_cast<float>(count);
      t.squared[static_cast<std::size_t>(r) * t.columns + c] = mean * mean;
    }
  }
  return t;
}

/// One pass over the image with blocks of a given edge.
class SelectionPass {
 public:
  SelectionPass(const std::vector<GradientMap>& scales, const RayTable& rays, const Thresholds& thresholds, int border)
      : scales_(scales), rays_(rays), thresholds_(thresholds), border_(border) {}

  std::vector<SelectedPixel> run(int block) const {
    const int w = scales_[0].width, h = scales_[0].height;
    const int scales = static_cast<int>(scales_.size());
    std::vector<SelectedPixel> chosen;
    const int coarsest = block << (scales - 1);
    for (int y = 0; y < h; y += coarsest) {
      for (int x = 0; x < w; x += coarsest) select_in_subblocks(x, y, block, scales - 1, chosen);
    }
    return chosen;
  }

 private:
  /// Selects pixels in the four sub-blocks; if there are none, the block's best pixel at this scale.
  bool select_in_subblocks(int x, int y, int block, int scale, std::vector<SelectedPixel>& chosen) const {
    bool any = false;
    if (scale > 0) {
      const int half = block << (scale - 1);
      for (const auto& [dx, dy] : {std::pair{0, 0}, {half, 0}, {0, half}, {half, half}}) {
        any |= select_in_subblocks(x + dx, y + dy, block, scale - 1, chosen);
      }
    }
    return any || select_best(x, y, block << scale, scale, chosen);
  }

  bool select_best(int x0, int y0, int edge, int scale, std::vector<SelectedPixel>& chosen) const {
    const GradientMap& level = scales_[scale];
    const int x1 = std::min(x0 + edge, scales_[0].width - border_);
    const int y1 = std::min(y0 + edge, scales_[0].height - border_);
    const float relax = std::pow(kScaleDownweight, static_cast<float>(2 * scale));
    x0 = std::max(x0, border_);
    y0 = std::max(y0, border_);
    if (x0 >= x1 || y0 >= y1) return false;
    SelectedPixel best{-1, -1, scale};
    // Most pixels are below any threshold of the block.
    float best_value = std::max(0.0F, thresholds_.lowest(x0, y0, x1, y1) * relax);
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        const int lx = std::min(x >> scale, level.width - 1), ly = std::min(y >> scale, level.height - 1);
        const float value = level.at(lx, ly);
        if (value <= best_value || value <= thresholds_.at(x, y) * relax || rays_.at(x, y).isZero(0)) continue;
        best_value = value;
        best.x = x;
        best.y = y;
      }
    }
    if (best.x >= 0) chosen.push_back(best);
    return best.x >= 0;
  }

  const std::vector<GradientMap>& scales_;
  const RayTable& rays_;
  const Thresholds& thresholds_;
  int border_;
};

/// Keeps `wanted` of the pixels, spread evenly over their order.
std::vector<SelectedPixel> subsample(const std::vector<SelectedPixel>& pixels, int wanted) {
  const auto count = static_cast<std::int64_t>(pixels.size());
  if (count <= wanted) return pixels;
  std::vector<SelectedPixel> kept;
  for (std::int64_t i = 0; i < wanted; ++i) kept.push_back(pixels[i * count / wanted]);
  return kept;
}

}  // namespace

std::vector<SelectedPixel> select_pixels(const Pyramid& pyramid, const RayTable& rays, int wanted,
                                         const SelectionOptions& options, int& block_px) {
  constexpr std::size_t kScales = 3;
  const PyramidLevel& level = pyramid.levels[0];
  std::vector<GradientMap> scales;
  for (std::size_t i = 0; i < std::min(kScales, pyramid.levels.size()); ++i) {
    scales.push_back(gradient_map(pyramid.levels[i]));
  }
  const Thresholds thresholds = region_thresholds(scales[0], options.min_gradient);
  const SelectionPass selection(scales, rays, thresholds, options.border_px);
  if (block_px == 0) {
    block_px = std::max(3, static_cast<int>(std::sqrt(static_cast<double>(level.width) * level.height / wanted) / 2));
  }
  std::vector<SelectedPixel> pixels = selection.run(block_px);
  // The count is at most proportional to 1 / block^2: aim slightly high, then thin out.
  constexpr int kAttempts = 4;
  for (int i = 0; i < kAttempts; ++i) {
    const double ratio = static_cast<double>(pixels.size()) / wanted;
    if (ratio >= 1.0 && ratio <= 1.5) break;
    const int next = std::clamp(static_cast<int>(std::lround(block_px * std::sqrt(ratio / 1.2))), 1, 64);
    if (next == block_px) break;
    block_px = next;
    pixels = selection.run(block_px);
  }
  return subsample(pixels, wanted);
}

}  // namespace tileflight::keyframes
