#include "tileflight/core/drawing/height_relief.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::drawing {

using geometry::Vec3;
using imaging::Rgb8;

imaging::Rgb8 height_color(double share) {
  // Dark blue to pale yellow, monotonically lighter: readable in grey and with any colour vision.
  constexpr std::array<Rgb8, 6> kAnchors{
      {{36, 44, 96}, {32, 93, 130}, {46, 142, 124}, {120, 184, 92}, {214, 209, 98}, {251, 244, 205}}};
  const double place = std::clamp(share, 0.0, 1.0) * (kAnchors.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(place), kAnchors.size() - 2);
  Rgb8 color{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double a = kAnchors[below][c], b = kAnchors[below + 1][c];
    color[c] = static_cast<std::uint8_t>(std::lround(a + (place - static_cast<double>(below)) * (b - a)));
  }
  return color;
}

imaging::FloatImage hill_shade(const imaging::FloatImage& heights_m, double pixel_m) {
  const Vec3 towards_light = Vec3(-1, 1, std::sqrt(2.0)).normalized();
  imaging::FloatImage shade(heights_m.width, heights_m.height, std::nanf(""));
  // Slope between the neighbours that have a surface.
  const auto slope = [&](int x, int y, int dx, int dy) {
    const auto at = [&](int step) {
      const int u = x + step * dx, v = y + step * dy;
      const bool inside = u >= 0 && v >= 0 && u < heights_m.width && v < heights_m.height;
      return inside && std::isfinite(heights_m(u, v)) ? std::optional(std::pair(step, double{heights_m(u, v)}))
                                                      : std::nullopt;
    };
    const auto before = at(-1) ? at(-1) : at(0), after = at(1) ? at(1) : at(0);
    const int steps = after->first - before->first;
    return steps > 0 ? (after->second - before->second) / (steps * pixel_m) : 0.0;
  };
  for (int y = 0; y < heights_m.height; ++y) {
    for (int x = 0; x < heights_m.width; ++x) {
      if (!std::isfinite(heights_m(x, y))) continue;
      const Vec3 normal = Vec3(-slope(x, y, 1, 0), -slope(x, y, 0, -1), 1).normalized();
      shade(x, y) = static_cast<float>(std::max(0.0, normal.dot(towards_light)) / towards_light.z());
    }
  }
  return shade;
}

}  // namespace tileflight::drawing
