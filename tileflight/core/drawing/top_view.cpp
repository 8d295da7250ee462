#include "tileflight/core/drawing/top_view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/drawing/drawing.h"
#include "tileflight/core/drawing/number_format.h"

namespace tileflight::drawing {
namespace {

using geometry::Vec3;

/// Pixels along the longer side of an image.
constexpr int kPixels = 1400;
/// Dots are larger if there are few.
int dot_pixels(std::size_t points) {
  return std::clamp(static_cast<int>(std::lround(0.5 * kPixels / std::sqrt(static_cast<double>(points) + 1.0))), 4, 8);
}
constexpr int kShades = 64;
/// Units of the SVG's view box.
constexpr double kPlot = 560, kViewLeft = 52, kViewRight = 10, kViewTop = 10, kViewBottom = 42;

/// Pixel grid over an extent. Row 0 is in the north.
struct Raster {
  GroundExtent extent;
  double pixels_per_m;
  int width, height;

  explicit Raster(const GroundExtent& e)
      : extent(e),
        pixels_per_m(kPixels / std::max(e.width_m(), e.height_m())),
        width(std::max(1, static_cast<int>(std::lround(e.width_m() * pixels_per_m)))),
        height(std::max(1, static_cast<int>(std::lround(e.height_m() * pixels_per_m)))) {}

  double column(double east) const { return (east - extent.west) * pixels_per_m; }
  double row(double north) const { return (extent.north - north) * pixels_per_m; }

  bool holds(const Vec3& p) const {
    return p.x() >= extent.west && p.x() <= extent.east && p.y() >= extent.south && p.y() <= extent.north;
  }

  /// Sets the pixels whose centres lie in a square around p; at least one.
  void fill_square(imaging::GrayImage& image, const Vec3& p, double side_pixels, std::uint8_t value) const {
    const auto range = [&](double middle, int size) {
      const int first = static_cast<int>(std::ceil(middle - side_pixels / 2 - 0.5));
      const int last = std::max(first, static_cast<int>(std::ceil(middle + side_pixels / 2 - 0.5)) - 1);
      return std::pair(std::clamp(first, 0, size - 1), std::clamp(last, 0, size - 1));
    };
    const auto [left, right] = range(column(p.x()), width);
    const auto [top, bottom] = range(row(p.y()), height);
    for (int y = top; y <= bottom; ++y) std::fill(image.row(y) + left, image.row(y) + right + 1, value);
  }
};

Rgba8 blend(const Rgba8& a, const Rgba8& b, double share) {
  Rgba8 result{};
  for (std::size_t i = 0; i < 4; ++i) result[i] = static_cast<std::uint8_t>(std::lround(a[i] + share * (b[i] - a[i])));
  return result;
}

/// Palette: index 0 is transparent, 1 to kShades range from `shade(0)` to `shade(1)`.
template <class Shade>
std::vector<Rgba8> palette_of(const Shade& shade) {
  std::vector<Rgba8> palette{{0, 0, 0, 0}};
  for (int i = 0; i < kShades; ++i) palette.push_back(shade(i / (kShades - 1.0)));
  return palette;
}

std::uint8_t shade_index(double share) {
  return static_cast<std::uint8_t>(1 + std::lround(std::clamp(share, 0.0, 1.0) * (kShades - 1)));
}

/// Indices of the points inside the extent, lowest first.
std::vector<std::size_t> sort_by_height(const Raster& raster, const std::vector<Vec3>& points) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (raster.holds(points[i])) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return points[a].z() < points[b].z(); });
  return order;
}

std::pair<double, double> range_of(const std::vector<Vec3>& points, int axis, double trimmed) {
  std::vector<double> values;
  for (const Vec3& p : points) values.push_back(p[axis]);
  return {base::lower_quantile(values, trimmed), base::lower_quantile(values, 1.0 - trimmed)};
}

/// Mapping from metres to the view box.
struct Plot {
  GroundExtent extent;
  double scale;  ///< units per metre
  double width, height;

  explicit Plot(const GroundExtent& e)
      : extent(e),
        scale(kPlot / std::max(e.width_m(), e.height_m())),
        width(e.width_m() * scale),
        height(e.height_m() * scale) {}

  double across(double east) const { return kViewLeft + (east - extent.west) * scale; }
  double down(double north) const { return kViewTop + (extent.north - north) * scale; }
};

Html view_label(double x, double y, const std::string& anchor, const std::string& content,
                const std::string& style = "") {
  return element("text", {{"x", svg_number(x)}, {"y", svg_number(y)}, {"text-anchor", anchor}, {"class", style}},
                 text(content));
}

Html axes(const Plot& plot, const TopView& view) {
  Html result = empty_element("rect", {{"x", svg_number(kViewLeft)},
                                       {"y", svg_number(kViewTop)},
                                       {"width", svg_number(plot.width)},
                                       {"height", svg_number(plot.height)},
                                       {"class", "frame"}});
  const double step = round_down_to_nice(std::max(plot.extent.width_m(), plot.extent.height_m()) / 4);
  const double bottom = kViewTop + plot.height;
  for (double east = std::ceil(plot.extent.west / step) * step; east <= plot.extent.east; east += step) {
    result += svg_line(plot.across(east), bottom, plot.across(east), bottom + 5, "axis");
    result += view_label(plot.across(east), bottom + 18, "middle", tick_text(east, step));
  }
  for (double north = std::ceil(plot.extent.south / step) * step; north <= plot.extent.north; north += step) {
    result += svg_line(kViewLeft - 5, plot.down(north), kViewLeft, plot.down(north), "axis");
    result += view_label(kViewLeft - 8, plot.down(north) + 4, "end", tick_text(north, step));
  }
  result += view_label(kViewLeft + plot.width / 2, bottom + 35, "middle", view.x_label);
  const std::string middle = svg_number(kViewTop + plot.height / 2);
  return result +
         element(
             "text",
             {{"x", "12"}, {"y", middle}, {"text-anchor", "middle"}, {"transform", "rotate(-90 12 " + middle + ")"}},
             text(view.y_label));
}

Html scale_bar(const Plot& plot) {
  const double length_m = round_down_to_nice(plot.extent.width_m() / 4);
  const double x = kViewLeft + 14, y = kViewTop + plot.height - 14;
  const Html bar = svg_line(x, y, x + length_m * plot.scale, y, "scale-bar");
  return bar + view_label(x + length_m * plot.scale / 2, y - 6, "middle", tick_text(length_m, length_m) + " m", "halo");
}

Html draw_image(const Plot& plot, const ImageLayer& layer) {
  return empty_element("image", {{"x", svg_number(kViewLeft)},
                                 {"y", svg_number(kViewTop)},
                                 {"width", svg_number(plot.width)},
                                 {"height", svg_number(plot.height)},
                                 {"preserveAspectRatio", "none"},
                                 {"class", "layer " + layer.name},
                                 {"href", data_uri("image/png", encode_png(layer.image))}});
}

std::string path_of(const Plot& plot, const TrackLayer& track) {
  std::string path;
  for (const Vec3& p : track.points) {
    const std::string at = svg_number(plot.across(p.x())) + " " + svg_number(plot.down(p.y()));
    path += track.dots ? "M" + at + "h0"
                       : (path.empty() ? "M" : "L") + at;  // a stroke of zero length with round ends is a dot
  }
  return path;
}

Html draw_track(const Plot& plot, const TrackLayer& track) {
  if (track.points.empty()) return {};
  const Html path =
      empty_element("path", {{"d", path_of(plot, track)}, {"class", (track.dots ? "dots " : "line ") + track.style}});
  if (track.dots) return path;
  const Vec3& start = track.points.front();
  return path + empty_element("circle", {{"cx", svg_number(plot.across(start.x()))},
                                         {"cy", svg_number(plot.down(start.y()))},
                                         {"r", "4.5"},
                                         {"class", "start " + track.style}});
}

}  // namespace

GroundExtent fit_extent(const std::vector<geometry::Vec3>& points, double margin, double trimmed) {
  if (points.empty()) return {-1, 1, -1, 1};
  const auto [west, east] = range_of(points, 0, trimmed);
  const auto [south, north] = range_of(points, 1, trimmed);
  const double border = std::max(1.0, margin * std::max(east - west, north - south));
  return {west - border, east + border, south - border, north + border};
}

GroundExtent limit_aspect_ratio(const GroundExtent& extent) {
  constexpr double kLeastShare = 0.75;
  const double east = std::max(0.0, kLeastShare * extent.height_m() - extent.width_m()) / 2;
  const double north = std::max(0.0, kLeastShare * extent.width_m() - extent.height_m()) / 2;
  return {extent.west - east, extent.east + east, extent.south - north, extent.north + north};
}

GroundExtent merge_extents(const GroundExtent& a, const GroundExtent& b) {
  return {std::min(a.west, b.west), std::max(a.east, b.east), std::min(a.south, b.south), std::max(a.north, b.north)};
}

PaletteImage draw_voxels(const GroundExtent& extent, const geometry::PointCloud& centers, double voxel_m) {
  const Raster raster(extent);
  const auto green = [](double share) { return blend({92, 156, 112, 255}, {212, 236, 212, 255}, share); };
  PaletteImage image{imaging::GrayImage(raster.width, raster.height), palette_of(green)};
  if (centers.empty()) return image;
  const auto [low, high] = range_of(centers.positions, 2, 0.02);
  for (const std::size_t i : sort_by_height(raster, centers.positions)) {
    const Vec3& p = centers.positions[i];
    raster.fill_square(image.indices, p, voxel_m * raster.pixels_per_m,
                       shade_index((p.z() - low) / std::max(high - low, 1e-9)));
  }
  return image;
}

PaletteImage draw_points(const GroundExtent& extent, const std::vector<geometry::Vec3>& points, const Rgba8& color) {
  const Raster raster(extent);
  PaletteImage image{imaging::GrayImage(raster.width, raster.height), {{0, 0, 0, 0}, color}};
  const int dot = dot_pixels(points.size());
  for (const Vec3& p : points) {
    if (raster.holds(p)) raster.fill_square(image.indices, p, dot, 1);
  }
  return image;
}

Rgba8 value_color(double share) {
  // Blue to red over gold: distinguishable with any colour vision, on light and dark backgrounds.
  constexpr std::array<Rgba8, 5> kAnchors{
      {{28, 111, 209, 255}, {79, 163, 165, 255}, {201, 162, 39, 255}, {232, 113, 10, 255}, {196, 22, 28, 255}}};
  const double place = std::clamp(share, 0.0, 1.0) * (kAnchors.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(place), kAnchors.size() - 2);
  return blend(kAnchors[below], kAnchors[below + 1], place - static_cast<double>(below));
}

PaletteImage draw_values(const GroundExtent& extent, const std::vector<geometry::Vec3>& points,
                         const std::vector<float>& values, double highest) {
  const Raster raster(extent);
  PaletteImage image{imaging::GrayImage(raster.width, raster.height), palette_of(value_color)};
  for (const std::size_t i : sort_by_height(raster, points)) {
    if (std::isfinite(values[i]))
      raster.fill_square(image.indices, points[i], dot_pixels(points.size()), shade_index(values[i] / highest));
  }
  return image;
}

Drawing to_drawing(const TopView& view) {
  const Plot plot(view.extent);
  Html content = element("title", text(view.title)) + element("desc", text(view.description)) + axes(plot, view);
  for (const ImageLayer& layer : view.images) content += draw_image(plot, layer);
  for (const TrackLayer& track : view.tracks) content += draw_track(plot, track);
  content += scale_bar(plot);
  // The width is the same for any extent, so that text has the same size in all views.
  return {kViewLeft + kPlot + kViewRight,
          kViewTop + plot.height + kViewBottom,
          "top-view",
          view.title + ". " + view.description,
          content,
          view.legend};
}

Drawing color_bar(double highest, const std::string& label_text) {
  constexpr int kSteps = 16;
  constexpr double kBar = 300;
  Html stops;
  for (int i = 0; i <= kSteps; ++i) {
    const Rgba8 c = value_color(static_cast<double>(i) / kSteps);
    const std::string color =
        "rgb(" + std::to_string(c[0]) + "," + std::to_string(c[1]) + "," + std::to_string(c[2]) + ")";
    stops += empty_element("stop", {{"offset", svg_number(static_cast<double>(i) / kSteps)}, {"stop-color", color}});
  }
  Html content = element("defs", element("linearGradient", {{"id", "error-colours"}}, stops));
  content += empty_element(
      "rect",
      {{"x", "20"}, {"y", "2"}, {"width", svg_number(kBar)}, {"height", "12"}, {"fill", "url(#error-colours)"}});
  const std::vector<double> ticks = nice_ticks(0, highest, 5);
  for (const double tick : ticks) {
    const std::string shown =
        tick_text(tick, ticks.size() > 1 ? ticks[1] : 1) + (tick >= highest * (1 - 1e-9) ? "+" : "");
    content += view_label(20 + tick / highest * kBar, 28, "middle", shown);
  }
  content += view_label(20 + kBar / 2, 44, "middle", label_text);
  const std::string label_of_bar =
      "Colours: " + label_text + ", blue is 0, red is " + svg_number(highest) + " and more";
  return {340, 50, "color-bar", label_of_bar, content};
}

}  // namespace tileflight::drawing
