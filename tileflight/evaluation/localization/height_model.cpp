#include "tileflight/evaluation/localization/height_model.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

namespace tileflight::localization {

using geometry::Vec2;
using geometry::Vec3;
using imaging::FloatImage;

namespace {

/// Medians of the cells with enough points; NaN elsewhere.
FloatImage medians(const std::vector<Vec3>& points, const Vec2& low, double cell, int width, int height) {
  constexpr std::size_t kEnough = 3;
  std::vector<std::pair<std::uint32_t, float>> values;  // cell, height
  for (const Vec3& p : points) {
    const double i = std::floor((p.x() - low.x()) / cell), j = std::floor((p.y() - low.y()) / cell);
    if (!(i >= 0.0 && j >= 0.0 && i < width && j < height)) continue;
    values.emplace_back(
        static_cast<std::uint32_t>(j) * static_cast<std::uint32_t>(width) + static_cast<std::uint32_t>(i),
        static_cast<float>(p.z()));
  }
  std::ranges::sort(values);
  FloatImage result(width, height, std::nanf(""));
  for (std::size_t begin = 0; begin < values.size();) {
    std::size_t end = begin;
    while (end < values.size() && values[end].first == values[begin].first) ++end;
    if (end - begin >= kEnough) result.pixels[values[begin].first] = values[begin + (end - begin) / 2].second;
    begin = end;
  }
  return result;
}

float bilinear(const FloatImage& image, double x, double y) {
  x = std::clamp(x, 0.0, image.width - 1.0), y = std::clamp(y, 0.0, image.height - 1.0);
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const int i1 = std::min(i + 1, image.width - 1), j1 = std::min(j + 1, image.height - 1);
  const auto a = static_cast<float>(x - i), b = static_cast<float>(y - j);
  return (1.0F - b) * ((1.0F - a) * image(i, j) + a * image(i1, j)) +
         b * ((1.0F - a) * image(i, j1) + a * image(i1, j1));
}

}  // namespace

HeightModel::HeightModel(const std::vector<Vec3>& points, const Vec2& low, const Vec2& high) : low_(low) {
  constexpr double kPointsACell = 4.0, kLargest = 256.0;
  const Vec2 size = (high - low).cwiseMax(1e-9);
  cell_ = std::sqrt(size.x() * size.y() * kPointsACell / std::max<double>(1.0, static_cast<double>(points.size())));
  cell_ = std::max(cell_, size.maxCoeff() / kLargest);
  struct Level {
    FloatImage heights;
    double cell;
  };
  std::vector<Level> levels;
  for (double cell = cell_;; cell *= 2.0) {
    const int width = std::max(1, static_cast<int>(std::ceil(size.x() / cell)));
    const int height = std::max(1, static_cast<int>(std::ceil(size.y() / cell)));
    levels.push_back({medians(points, low, cell, width, height), cell});
    if (width == 1 && height == 1) break;
  }
  heights_ = levels.back().heights;
  float& all = heights_.pixels.front();
  if (!std::isfinite(all)) all = points.empty() ? 0.0F : static_cast<float>(points.front().z());
  for (std::size_t k = levels.size() - 1; k-- > 0;) {
    FloatImage filled = levels[k].heights;
    for (int y = 0; y < filled.height; ++y) {
      for (int x = 0; x < filled.width; ++x)
        if (!std::isfinite(filled(x, y))) filled(x, y) = bilinear(heights_, 0.5 * x - 0.25, 0.5 * y - 0.25);
    }
    heights_ = std::move(filled);
  }
  constexpr std::size_t kNear = 2;  // levels
  supported_ = imaging::GrayImage(heights_.width, heights_.height);
  for (std::size_t k = 0; k <= std::min(kNear, levels.size() - 1); ++k) {
    const FloatImage& known = levels[k].heights;
    for (int y = 0; y < supported_.height; ++y) {
      for (int x = 0; x < supported_.width; ++x) {
        const int i = std::min(x >> k, known.width - 1), j = std::min(y >> k, known.height - 1);
        if (std::isfinite(known(i, j))) supported_(x, y) = 255;
      }
    }
  }
}

double HeightModel::at(const Vec2& position) const {
  const Vec2 p = (position - low_) / cell_;
  return bilinear(heights_, p.x() - 0.5, p.y() - 0.5);
}

bool HeightModel::is_supported(const Vec2& position) const {
  const Vec2 p = (position - low_) / cell_;
  if (!(p.x() >= 0.0 && p.y() >= 0.0 && p.x() < supported_.width && p.y() < supported_.height)) return false;
  return supported_(static_cast<int>(p.x()), static_cast<int>(p.y())) != 0;
}

}  // namespace tileflight::localization
