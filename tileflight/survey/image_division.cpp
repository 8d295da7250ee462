#include "tileflight/survey/image_division.h"

#include "tileflight/render/camera_renderer.h"

namespace tileflight::survey {
namespace {

using imaging::PixelRegion;

/// The multiple of `step` in the middle of a range, or its end if it has none.
int middle_of(int begin, int end, int step) {
  const int steps = (end - begin + step - 1) / step;
  return steps < 2 ? end : begin + steps / 2 * step;
}

}  // namespace

std::optional<std::pair<PixelRegion, PixelRegion>> halves_of(const PixelRegion& region) {
  const int x = middle_of(region.x0, region.x1, render::kRegionStepX);
  const int y = middle_of(region.y0, region.y1, render::kRegionStepY);
  if (x == region.x1 && y == region.y1) return std::nullopt;
  const bool across_columns = y == region.y1 || (x < region.x1 && region.width() >= region.height());
  if (across_columns)
    return std::pair(PixelRegion{region.x0, region.y0, x, region.y1}, PixelRegion{x, region.y0, region.x1, region.y1});
  return std::pair(PixelRegion{region.x0, region.y0, region.x1, y}, PixelRegion{region.x0, y, region.x1, region.y1});
}

std::vector<PixelRegion> divide_image(int width, int height, const std::function<double(const PixelRegion&)>& bytes_of,
                                      double budget_bytes) {
  std::vector<PixelRegion> regions;
  const auto divide = [&](const auto& again, const PixelRegion& region, bool is_whole) -> void {
    const auto halves = halves_of(region);
    if (!halves || (!is_whole && bytes_of(region) <= budget_bytes)) {
      regions.push_back(region);
      return;
    }
    again(again, halves->first, false);
    again(again, halves->second, false);
  };
  divide(divide, {0, 0, width, height}, true);
  return regions;
}

}  // namespace tileflight::survey
