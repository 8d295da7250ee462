#include "tileflight/slam/tracking/tracking_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>

#include "tileflight/core/base/simd.h"

namespace tileflight::tracking {
namespace {

/// Weighted inverse distances at some pixels of a level, while a TrackingReference is built.
struct SparsePixel {
  int index = 0;  ///< y * width + x
  float weighted_rho = 0.0F;
  float weight = 0.0F;
};

/// A level's pixels with a sum, each once, row by row: some thousand of the hundreds of thousands that a level has.
struct SparseDepth {
  int width = 0;
  int height = 0;
  std::vector<SparsePixel> pixels;

  bool is_inside(int index, int border) const {
    const int x = index % width, y = index / width;
    return index >= 0 && x >= border && y >= border && x < width - border && y < height - border;
  }
};

/// Sums of the values at each pixel, added in the given order.
std::vector<SparsePixel> sums_by_pixel(std::vector<SparsePixel> values) {
  std::stable_sort(values.begin(), values.end(),
                   [](const SparsePixel& a, const SparsePixel& b) { return a.index < b.index; });
  std::vector<SparsePixel> sums;
  for (const SparsePixel& value : values) {
    if (sums.empty() || sums.back().index != value.index) sums.push_back({value.index});
    sums.back().weighted_rho += value.weighted_rho;
    sums.back().weight += value.weight;
  }
  return sums;
}

SparseDepth downsample(const SparseDepth& fine) {
  SparseDepth half{fine.width / 2, fine.height / 2, {}};
  for (const SparsePixel& pixel : fine.pixels) {
    const int x = pixel.index % fine.width / 2, y = pixel.index / fine.width / 2;
    if (x < half.width && y < half.height)
      half.pixels.push_back({y * half.width + x, pixel.weighted_rho, pixel.weight});
  }
  half.pixels = sums_by_pixel(std::move(half.pixels));
  return half;
}

/// Fills empty pixels with the mean of their filled neighbours (the diagonal ones on fine levels, because they are
/// farther apart): the dilation of DSO, section 3.1, step 1. The pixels and their neighbours are five sorted lists, the
/// same one shifted, which are merged.
SparseDepth dilate(const SparseDepth& depth, bool diagonal) {
  constexpr int kNone = std::numeric_limits<int>::max();
  const int up = depth.width;
  // To a pixel's own value, which comes first, and to its neighbours.
  const std::array<int, 5> steps =
      diagonal ? std::array<int, 5>{0, -up - 1, -up + 1, up - 1, up + 1} : std::array<int, 5>{0, -1, 1, -up, up};
  SparseDepth out{depth.width, depth.height, {}};
  std::array<std::size_t, 5> at{};  // by list: its next pixel
  const auto next_of = [&](std::size_t k) {
    return at[k] < depth.pixels.size() ? depth.pixels[at[k]].index - steps[k] : kNone;
  };
  while (true) {
    int index = kNone;
    for (std::size_t k = 0; k < steps.size(); ++k) index = std::min(index, next_of(k));
    if (index == kNone) return out;
    SparsePixel sum{index};
    bool complete = false;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      if (next_of(k) == index) {
        const SparsePixel& pixel = depth.pixels[at[k]++];
        if (!complete) sum.weighted_rho += pixel.weighted_rho, sum.weight += pixel.weight;
      }
      if (k == 0) complete = sum.weight > 0 || !depth.is_inside(index, 1);
    }
    if (sum.weight > 0) out.pixels.push_back(sum);
  }
}

ReferenceLevel to_reference_level(const SparseDepth& depth, const keyframes::PyramidLevel& picture,
                                  const keyframes::LensPyramid& lens, std::size_t l, std::int64_t most) {
  constexpr int kBorder = 2;
  ReferenceLevel level;
  const auto filled = static_cast<std::int64_t>(depth.pixels.size());
  const std::int64_t kept = std::min<std::int64_t>(filled, most);
  std::int64_t seen = 0;
  for (const SparsePixel& pixel : depth.pixels) {
    const int x = pixel.index % depth.width, y = pixel.index / depth.width;
    if (!depth.is_inside(pixel.index, kBorder) || lens.rays[l].at(x, y).isZero(0)) continue;
    ++seen;
    if (seen * kept / filled == (seen - 1) * kept / filled) continue;  // keeps every (filled / kept)-th pixel
    level.add(Eigen::Vector2f(x, y), lens.ray(l, x, y), pixel.weighted_rho / pixel.weight, picture.intensity(x, y));
  }
  level.pad();
  return level;
}

}  // namespace

void ReferenceLevel::add(const Eigen::Vector2f& pixel, const Eigen::Vector3f& unit_ray, float inverse_distance,
                         float grey) {
  pixels.push_back(pixel);
  for (int d = 0; d < 3; ++d) ray[d].push_back(unit_ray[d]);
  rho.push_back(inverse_distance);
  intensity.push_back(grey);
}

void ReferenceLevel::pad() {
  const std::size_t filled = (size() + base::kLanes - 1) / base::kLanes * base::kLanes;
  for (int d = 0; d < 3; ++d) ray[d].resize(filled, d == 2 ? 1.0F : 0.0F);
  rho.resize(filled, 0.0F);
  intensity.resize(filled, 0.0F);
}

TrackingReference make_tracking_reference(const keyframes::LensPyramid& lens, const keyframes::Pyramid& keyframe,
                                          const std::vector<ReferencePoint>& points) {
  SparseDepth depth{keyframe.levels[0].width, keyframe.levels[0].height, {}};
  for (const ReferencePoint& point : points) {
    const int x = static_cast<int>(std::lround(point.pixel.x())), y = static_cast<int>(std::lround(point.pixel.y()));
    if (x < 0 || y < 0 || x >= depth.width || y >= depth.height) continue;
    depth.pixels.push_back({y * depth.width + x, point.weight * point.rho, point.weight});
  }
  depth.pixels = sums_by_pixel(std::move(depth.pixels));
  // By level. More pixels take time and add little information about eight unknowns. Chosen by hand.
  constexpr std::array<std::int64_t, 3> kMostPixels{6000, 3000, 2000};
  TrackingReference reference;
  for (std::size_t l = 0; l < keyframe.levels.size(); ++l) {
    if (l > 0) depth = downsample(depth);
    reference.levels.push_back(to_reference_level(dilate(depth, l < 2), keyframe.levels[l], lens, l,
                                                  kMostPixels[std::min<std::size_t>(l, 2)]));
  }
  return reference;
}

}  // namespace tileflight::tracking
