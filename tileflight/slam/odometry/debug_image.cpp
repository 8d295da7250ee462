#include "tileflight/slam/odometry/debug_image.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace tileflight::odometry {
namespace {

struct Range {
  double far = 0.0, near = 1.0;  ///< inverse distances

  double normalized(double inverse_distance) const {
    return near > far ? std::clamp((inverse_distance - far) / (near - far), 0.0, 1.0) : 0.5;
  }
};

Range inverse_distance_range(const std::vector<KeyframeView::Point>& points) {
  std::vector<float> values;
  for (const KeyframeView::Point& point : points) values.push_back(point.inverse_distance);
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  return {values[values.size() / 20], values[values.size() - 1 - values.size() / 20]};
}

void fill_square(imaging::RgbImage& image, int x, int y, int reach, const imaging::Rgb8& color) {
  for (int yy = std::max(0, y - reach); yy <= std::min(image.height - 1, y + reach); ++yy) {
    for (int xx = std::max(0, x - reach); xx <= std::min(image.width - 1, x + reach); ++xx) image(xx, yy) = color;
  }
}

}  // namespace

imaging::Rgb8 depth_color(double share) {
  // Colour stops along the rainbow, from far to near.
  constexpr std::array<std::array<double, 3>, 5> kStops{{{0, 0, 1}, {0, 1, 1}, {0, 1, 0}, {1, 1, 0}, {1, 0, 0}}};
  const double at = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double rest = at - static_cast<double>(below);
  imaging::Rgb8 color{};
  for (int c = 0; c < 3; ++c) {
    const double value = kStops[below][c] + rest * (kStops[below + 1][c] - kStops[below][c]);
    color[c] = static_cast<std::uint8_t>(std::lround(255.0 * value));
  }
  return color;
}

imaging::RgbImage draw_debug_image(const KeyframeView& view) {
  constexpr int kPointsAcross = 500;  ///< point spacing: this many across the image width stay distinguishable
  imaging::RgbImage image = imaging::to_rgb(imaging::to_gray(view.image));
  const int reach = std::max(1, image.width / kPointsAcross);
  const Range range = inverse_distance_range(view.points);
  for (const KeyframeView::Point& point : view.points) {
    fill_square(image, static_cast<int>(std::lround(point.x)), static_cast<int>(std::lround(point.y)), reach,
                depth_color(range.normalized(point.inverse_distance)));
  }
  return image;
}

}  // namespace tileflight::odometry
