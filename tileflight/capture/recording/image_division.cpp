#include "tileflight/capture/recording/image_division.h"

#include "tileflight/capture/render/camera_renderer.h"

namespace tileflight::recording {
namespace {

using imaging::PixelRegion;
using Halves = std::pair<PixelRegion, PixelRegion>;

/// A bound of regions in the middle of a range, or its end if it has none.
int middle_of(int begin, int end) {
  const int steps = (end - begin + render::kRegionStep - 1) / render::kRegionStep;
  return steps < 2 ? end : begin + steps / 2 * render::kRegionStep;
}

}  // namespace

std::optional<Halves> halves_of(const PixelRegion& region, const RegionBytes& bytes_of) {
  const int x = middle_of(region.x0, region.x1);
  const int y = middle_of(region.y0, region.y1);
  const Halves beside{{region.x0, region.y0, x, region.y1}, {x, region.y0, region.x1, region.y1}};
  const Halves above{{region.x0, region.y0, region.x1, y}, {region.x0, y, region.x1, region.y1}};
  if (x == region.x1 && y == region.y1) return std::nullopt;
  if (x == region.x1) return above;
  if (y == region.y1) return beside;
  const auto bytes = [&](const Halves& halves) { return bytes_of(halves.first) + bytes_of(halves.second); };
  const double beside_bytes = bytes(beside), above_bytes = bytes(above);
  const bool is_wide = region.width() >= region.height();
  return beside_bytes < above_bytes || (beside_bytes == above_bytes && is_wide) ? beside : above;
}

std::vector<PixelRegion> divide_image(int width, int height, const RegionBytes& bytes_of, double budget_bytes) {
  std::vector<PixelRegion> regions;
  const auto divide = [&](const auto& again, const PixelRegion& region, bool is_whole) -> void {
    const auto halves =
        is_whole || bytes_of(region) > budget_bytes ? halves_of(region, bytes_of) : std::optional<Halves>();
    if (!halves) {
      regions.push_back(region);
      return;
    }
    again(again, halves->first, false);
    again(again, halves->second, false);
  };
  divide(divide, {0, 0, width, height}, true);
  return regions;
}

}  // namespace tileflight::recording
