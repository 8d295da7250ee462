#include "tileflight/tracking/tracking_reference.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "tileflight/base/simd.h"

namespace tileflight::tracking {
namespace {

/// Weighted inverse distances over a whole level, while a TrackingReference is built.
struct SparseDepth {
  int width = 0;
  int height = 0;
  std::vector<float> weighted_rho;
  std::vector<float> weight;

  SparseDepth(int w, int h)
      : width(w), height(h), weighted_rho(static_cast<std::size_t>(w) * h), weight(weighted_rho.size()) {}
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y) * width + x; }
};

SparseDepth downsample(const SparseDepth& fine) {
  SparseDepth half(fine.width / 2, fine.height / 2);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      const std::size_t to = half.index(x, y);
      for (const std::size_t from : {fine.index(2 * x, 2 * y), fine.index(2 * x + 1, 2 * y),
                                     fine.index(2 * x, 2 * y + 1), fine.index(2 * x + 1, 2 * y + 1)}) {
        half.weighted_rho[to] += fine.weighted_rho[from];
        half.weight[to] += fine.weight[from];
      }
    }
  }
  return half;
}

/// Fills empty pixels with the mean of their filled neighbours (the diagonal ones on fine levels, because they are
/// farther apart): the dilation of DSO, section 3.1, step 1.
SparseDepth dilate(const SparseDepth& depth, bool diagonal) {
  SparseDepth out = depth;
  for (int y = 1; y < depth.height - 1; ++y) {
    for (int x = 1; x < depth.width - 1; ++x) {
      const std::size_t i = depth.index(x, y);
      if (depth.weight[i] > 0) continue;
      const int up = depth.width;
      const std::array<int, 4> steps =
          diagonal ? std::array<int, 4>{-up - 1, -up + 1, up - 1, up + 1} : std::array<int, 4>{-1, 1, -up, up};
      for (const int step : steps) {
        out.weighted_rho[i] += depth.weighted_rho[i + step];
        out.weight[i] += depth.weight[i + step];
      }
    }
  }
  return out;
}

ReferenceLevel to_reference_level(const SparseDepth& depth, const photometry::PyramidLevel& picture,
                                  const photometry::LensPyramid& lens, std::size_t l, std::int64_t most) {
  constexpr int kBorder = 2;
  ReferenceLevel level;
  const auto filled = std::count_if(depth.weight.begin(), depth.weight.end(), [](float w) { return w > 0; });
  const std::int64_t kept = std::min<std::int64_t>(filled, most);
  std::int64_t seen = 0;
  for (int y = kBorder; y < depth.height - kBorder; ++y) {
    for (int x = kBorder; x < depth.width - kBorder; ++x) {
      const std::size_t i = depth.index(x, y);
      if (depth.weight[i] <= 0 || lens.rays[l].at(x, y).isZero(0)) continue;
      ++seen;
      if (seen * kept / filled == (seen - 1) * kept / filled) continue;  // keeps every (filled / kept)-th pixel
      level.add(Eigen::Vector2f(x, y), lens.ray(l, x, y), depth.weighted_rho[i] / depth.weight[i],
                picture.intensity(x, y));
    }
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

TrackingReference make_tracking_reference(const photometry::LensPyramid& lens, const photometry::Pyramid& keyframe,
                                          const std::vector<ReferencePoint>& points) {
  SparseDepth depth(keyframe.levels[0].width, keyframe.levels[0].height);
  for (const ReferencePoint& point : points) {
    const int x = static_cast<int>(std::lround(point.pixel.x())), y = static_cast<int>(std::lround(point.pixel.y()));
    if (x < 0 || y < 0 || x >= depth.width || y >= depth.height) continue;
    depth.weighted_rho[depth.index(x, y)] += point.weight * point.rho;
    depth.weight[depth.index(x, y)] += point.weight;
  }
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
