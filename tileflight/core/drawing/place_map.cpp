#include "tileflight/core/drawing/place_map.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/raster_figure.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::drawing {
using geometry::Vec2;
using geometry::Vec3;
using imaging::Rgb8;
using plate::PlotArea;
using plate::Side;

namespace {

constexpr double kMapMargin_px = 26, kLine_px = 20;
/// Margins around a panel, for its axes.
constexpr double kMapLeft_px = 74, kMapTop_px = 46, kMapBottom_px = 54, kMapRight_px = 92, kBar_px = 200;
constexpr double kLegend_px = 34;
/// Above this aspect ratio the heights are drawn below the image.
constexpr double kWide = 1.5;
constexpr int kMapTicks = 6;

constexpr Rgb8 kHatchPaper{236, 237, 239}, kHatchLine{202, 204, 208};
constexpr Ink kPath{0.05, 0.25, 0.85, 1.0};
constexpr std::array<Ink, 3> kViews{{{0.10, 0.55, 0.20, 1.0}, {0.90, 0.45, 0.00, 1.0}, {0.62, 0.10, 0.60, 1.0}}};

bool is_hatched(int x, int y) { return (x + y) % 9 < 2; }

/// Range of heights covered by the colour scale, without the outermost hundredth on each side.
struct Range {
  double low = 0.0, high = 1.0;
  double share(double height_m) const { return (height_m - low) / (high - low); }
};

Range shown_range(const imaging::FloatImage& heights_m) {
  std::vector<float> finite;
  std::copy_if(heights_m.pixels.begin(), heights_m.pixels.end(), std::back_inserter(finite),
               [](float h) { return std::isfinite(h); });
  if (finite.empty()) return {};
  const auto at = [&](double share) {
    const auto place = finite.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(finite.size() - 1));
    std::nth_element(finite.begin(), place, finite.end());
    return double{*place};
  };
  const Range range{at(0.01), at(0.99)};
  constexpr double kLeast_m = 0.02;  // minimum range for a level place
  const double short_m = std::max(0.0, kLeast_m - (range.high - range.low));
  return {range.low - short_m / 2, range.high + short_m / 2};
}

/// The image where there is a surface, hatched elsewhere.
imaging::RgbImage on_hatched_paper(const imaging::RgbImage& colors, const imaging::FloatImage& heights_m) {
  imaging::RgbImage out(colors.width, colors.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      const Rgb8 paper = is_hatched(x, y) ? kHatchLine : kHatchPaper;
      out(x, y) = std::isfinite(heights_m(x, y)) ? colors(x, y) : paper;
    }
  }
  return out;
}

imaging::RgbImage height_picture(const GroundImage& ground, const Range& range) {
  const imaging::FloatImage shade = hill_shade(ground.heights_m, ground.extent.width_m() / ground.heights_m.width);
  imaging::RgbImage out(shade.width, shade.height);
  for (std::size_t i = 0; i < out.pixels.size(); ++i) {
    const float height_m = ground.heights_m.pixels[i];
    if (!std::isfinite(height_m)) continue;
    const Rgb8 color = height_color(range.share(height_m));
    const double light = 0.45 + 0.55 * std::min(1.35F, shade.pixels[i]);
    for (std::size_t c = 0; c < 3; ++c)
      out.pixels[i][c] = static_cast<std::uint8_t>(std::lround(std::clamp(light * color[c], 0.0, 255.0)));
  }
  return out;
}

/// Mapping from the ground to a panel.
struct MapPanel {
  PlotArea frame;
  GroundExtent extent;

  plate::AxisScale east() const { return {extent.west, extent.east, frame.x, frame.right()}; }
  plate::AxisScale north() const { return {extent.south, extent.north, frame.bottom(), frame.y}; }
  Vec2 at(const Vec2& ground) const { return {east().to_px(ground.x()), north().to_px(ground.y())}; }
  std::vector<Vec2> at(const std::vector<Vec2>& ground) const {
    std::vector<Vec2> points;
    for (const Vec2& p : ground) points.push_back(at(p));
    return points;
  }
};

std::string degrees_text(const DegreeTick& tick) {
  const int decimals = std::clamp(static_cast<int>(std::ceil(-std::log10(tick.step) - 1e-9)), 0, 8);
  const std::string digits = format_fixed(std::abs(tick.degrees), decimals);
  const bool is_below = tick.degrees < 0 && digits.find_first_of("123456789") != std::string::npos;
  return (is_below ? "\u2212" : "") + digits + "°";
}

void draw_degrees(Canvas& canvas, const MapPanel& panel, const geometry::LocalFrame& frame) {
  std::vector<plate::Tick> across, up;
  for (const DegreeTick& tick : degree_ticks(panel.extent, frame, true, 4))
    across.push_back({panel.east().to_px(panel.extent.west + tick.along_m), degrees_text(tick)});
  for (const DegreeTick& tick : degree_ticks(panel.extent, frame, false, 4))
    up.push_back({panel.north().to_px(panel.extent.south + tick.along_m), degrees_text(tick)});
  draw_axis(canvas, panel.frame, Side::kTop, across, "longitude");
  draw_axis(canvas, panel.frame, Side::kRight, up, "latitude");
}

void draw_grid(Canvas& canvas, const MapPanel& panel) {
  const auto east = plate::make_ticks(panel.east(), kMapTicks), north = plate::make_ticks(panel.north(), kMapTicks);
  const PlotArea& f = panel.frame;
  const auto draw = [&](const Vec2& a, const Vec2& b) {  // light on dark and dark on light
    canvas.draw_line({a, b}, {{0, 0, 0, 0.22}, 2.0, {}});
    canvas.draw_line({a, b}, {{1, 1, 1, 0.55}, 0.8, {}});
  };
  for (const plate::Tick& tick : east) draw({tick.at_px, f.y}, {tick.at_px, f.bottom()});
  for (const plate::Tick& tick : north) draw({f.x, tick.at_px}, {f.right(), tick.at_px});
  draw_axis(canvas, f, Side::kBottom, east, "east, m (local frame)");
  draw_axis(canvas, f, Side::kLeft, north, "north, m (local frame)");
}

void draw_scale_bar(Canvas& canvas, const MapPanel& panel) {
  const double length_m = round_down_to_nice(panel.extent.width_m() / 4);
  const double length_px = length_m / panel.extent.width_m() * panel.frame.width;
  const double x = panel.frame.x + 18, y = panel.frame.bottom() - 18;
  const std::vector<Vec2> bar{{x, y - 6}, {x, y}, {x + length_px, y}, {x + length_px, y - 6}};
  canvas.draw_line(bar, {plate::kHalo, 6.0, {}});
  canvas.draw_line(bar, {plate::kInk, 2.4, {}});
  TextStyle style = plate::overlay_lettering();
  style.anchor = TextAnchor::kMiddle;
  canvas.draw_text(x + length_px / 2, y - 9, format_shortest(length_m) + " m", style);
}

void draw_north_arrow(Canvas& canvas, const MapPanel& panel) {
  const double x = panel.frame.right() - 34, y = panel.frame.y + 38;
  canvas.fill_disc({x, y}, 25, plate::kHalo);
  canvas.fill_polygon({{x, y - 20}, {x - 8, y + 6}, {x, y + 1}}, plate::kInk);
  canvas.draw_line({{x, y - 20}, {x + 8, y + 6}, {x, y + 1}}, {plate::kInk, 1.4, {}}, true);
  TextStyle style = plate::body_lettering(13);
  style.bold = true;
  style.anchor = TextAnchor::kMiddle;
  canvas.draw_text(x, y + 19, "N", style);
}

Ink outline_ink(MapOutline::Kind kind) {
  return kind == MapOutline::Kind::kMissingTile ? plate::kWarning : Ink{0.0, 0.0, 0.0, 1.0};
}

void draw_outline(Canvas& canvas, const MapPanel& panel, const MapOutline& outline) {
  const std::vector<Vec2> points = panel.at(outline.corners);
  Ink ink = outline_ink(outline.kind);
  if (outline.kind == MapOutline::Kind::kMissingTile) {
    ink.opacity = 0.25;
    canvas.fill_polygon(points, ink);
    ink.opacity = 1.0;
  }
  canvas.draw_line(points, {{1, 1, 1, 0.9}, 3.5, {}}, true);
  canvas.draw_line(points, {ink, 1.8, {8, 5}}, true);
}

/// Draws viewing directions at some frames.
void draw_headings(Canvas& canvas, const MapPanel& panel, const FlightOverlay& flight) {
  constexpr double kApart_px = 26, kLength_px = 13;
  double along_px = kApart_px;
  for (std::size_t i = 0; i < flight.positions.size(); ++i) {
    const Vec2 at = panel.at(Vec2(flight.positions[i].head<2>()));
    if (i > 0) along_px += (at - panel.at(Vec2(flight.positions[i - 1].head<2>()))).norm();
    if (along_px < kApart_px) continue;
    along_px = 0;
    const Vec2 end = at + kLength_px * Vec2(flight.headings[i].x(), -flight.headings[i].y());
    canvas.draw_line({at, end}, {{1, 1, 1, 0.9}, 3.4, {}});
    canvas.draw_line({at, end}, {kPath, 1.6, {}});
  }
}

void draw_view(Canvas& canvas, const MapPanel& panel, const ViewFootprint& view, const Ink& ink) {
  const std::vector<Vec2> outline = panel.at(view.footprint);
  canvas.fill_polygon(outline, {ink.red, ink.green, ink.blue, 0.10});
  canvas.draw_line(outline, {{1, 1, 1, 0.8}, 3.2, {}}, true);
  canvas.draw_line(outline, {ink, 1.6, {}}, true);
}

void draw_camera(Canvas& canvas, const MapPanel& panel, const ViewFootprint& view, const Ink& ink) {
  const Vec2 at = panel.at(Vec2(view.position.head<2>()));
  canvas.fill_disc(at, 7.5, {1, 1, 1, 1});
  canvas.fill_disc(at, 5.5, ink);
  canvas.draw_text(at.x() + 10, at.y() - 8, view.name, plate::overlay_lettering());
}

void draw_flight(Canvas& canvas, const MapPanel& panel, const FlightOverlay& flight) {
  std::vector<Vec2> path;
  for (const Vec3& p : flight.positions) path.push_back(panel.at(Vec2(p.head<2>())));
  for (std::size_t i = 0; i < flight.views.size(); ++i)
    draw_view(canvas, panel, flight.views[i], kViews[i % kViews.size()]);
  draw_headings(canvas, panel, flight);
  canvas.draw_line(path, {{1, 1, 1, 0.9}, 5.0, {}});
  canvas.draw_line(path, {kPath, 2.4, {}});
  for (const std::size_t i : flight.colliding_frames) canvas.fill_disc(path[i], 4.0, plate::kWarning);
  for (std::size_t i = 0; i < flight.views.size(); ++i)
    draw_camera(canvas, panel, flight.views[i], kViews[i % kViews.size()]);
}

/// Places legend entries one after the other below the image.
class Legend {
 public:
  Legend(Canvas& canvas, double x, double y) : canvas_(canvas), x_(x), y_(y) {}

  void add_hatch(const std::string& name) {
    canvas_.fill_rectangle(x_, y_ - 10, 24, 13, to_ink(kHatchPaper));
    canvas_.clip(x_, y_ - 10, 24, 13);
    for (int i = -14; i < 26; i += 9)
      canvas_.draw_line({{x_ + i, y_ + 4}, {x_ + i + 15, y_ - 11}}, {to_ink(kHatchLine), 2.0, {}});
    canvas_.unclip();
    add_name(name);
  }
  void add_line(const std::string& name, const Stroke& stroke) {
    canvas_.draw_line({{x_, y_ - 4}, {x_ + 24, y_ - 4}}, stroke);
    add_name(name);
  }
  void add_disc(const std::string& name, const Ink& ink) {
    canvas_.fill_disc({x_ + 12, y_ - 4}, 4.5, ink);
    add_name(name);
  }

 private:
  void add_name(const std::string& name) {
    canvas_.draw_text(x_ + 31, y_, name, plate::body_lettering(13));
    x_ += 31 + canvas_.text_width(name, plate::body_lettering(13)) + 24;
  }

  Canvas& canvas_;
  double x_, y_;
};

bool has_gap(const imaging::FloatImage& heights_m) {
  return std::ranges::any_of(heights_m.pixels, [](float h) { return !std::isfinite(h); });
}

bool has_outline(const PlaceMap& map, MapOutline::Kind kind) {
  return std::ranges::any_of(map.outlines, [&](const MapOutline& outline) { return outline.kind == kind; });
}

void draw_legend(Canvas& canvas, const PlaceMap& map, double x, double y) {
  Legend legend(canvas, x, y);
  if (has_gap(map.ground.heights_m)) legend.add_hatch("no surface");
  if (has_outline(map, MapOutline::Kind::kMissingTile))
    legend.add_line("tile missing or broken", {plate::kWarning, 1.8, {8, 5}});
  if (has_outline(map, MapOutline::Kind::kProposedRegion))
    legend.add_line("proposed region", {{0, 0, 0, 1}, 1.8, {8, 5}});
  if (!map.flight) return;
  legend.add_line("path, and where the camera looks", {kPath, 2.4, {}});
  for (std::size_t i = 0; i < map.flight->views.size(); ++i)
    legend.add_line("seen in the " + map.flight->views[i].name, {kViews[i % kViews.size()], 1.8, {}});
  if (!map.flight->colliding_frames.empty()) legend.add_disc("inside or through a surface", plate::kWarning);
}

void draw_height_bar(Canvas& canvas, const PlaceMap& map, const PlotArea& panel, const Range& range) {
  const PlotArea bar{panel.right() + 26, panel.y, 20, panel.height};
  for (int y = 0; y < static_cast<int>(bar.height); ++y) {
    const Rgb8 color = height_color(1.0 - (y + 0.5) / bar.height);
    canvas.fill_rectangle(bar.x, bar.y + y, bar.width, 1, to_ink(color));
  }
  draw_border(canvas, bar);
  const plate::AxisScale local{range.low, range.high, bar.bottom(), bar.y};
  if (!map.frame) {
    draw_axis(canvas, bar, Side::kRight, plate::make_ticks(local, 8), "height (z of the local frame), m");
    return;
  }
  const double origin_m = map.frame->origin().height.m;
  plate::AxisScale ellipsoidal = local;
  ellipsoidal.low += origin_m;
  ellipsoidal.high += origin_m;
  draw_axis(canvas, bar, Side::kRight, plate::make_ticks(local, 8), "up, m (local frame)");
  const PlotArea beyond{bar.x, bar.y, bar.width + 84, bar.height};
  draw_axis(canvas, beyond, Side::kRight, plate::make_ticks(ellipsoidal, 8), "above the ellipsoid, m");
}

/// Positions of the parts on the canvas.
struct Layout {
  PlotArea picture, heights;
  double text_top = kMapMargin_px + 22, width = 0, height = 0, legend_y = 0;
};

Layout layout_of(const PlaceMap& map) {
  const double w = map.ground.colors.width, h = map.ground.colors.height;
  const double head = kMapMargin_px + 34 + kLine_px * static_cast<double>(map.notes.size());
  const double top = head + (map.frame ? kMapTop_px : 12);
  const double right = map.frame ? kMapRight_px : 24;
  Layout layout;
  layout.picture = {kMapMargin_px + kMapLeft_px, top, w, h};
  layout.legend_y = layout.picture.bottom() + kMapBottom_px + kLegend_px - 10;
  const bool below = w > kWide * h;
  layout.heights = below ? PlotArea{layout.picture.x, layout.legend_y + 24, w, h}
                         : PlotArea{layout.picture.right() + right + kMapLeft_px, top, w, h};
  layout.width = layout.heights.right() + kBar_px + kMapMargin_px;
  layout.height = (below ? layout.heights.bottom() + kMapBottom_px : layout.legend_y) + 2 * kMapMargin_px;
  return layout;
}

void draw_text(Canvas& canvas, const PlaceMap& map, const Layout& layout) {
  const double width = layout.width - 2 * kMapMargin_px;
  canvas.draw_text(kMapMargin_px, layout.text_top,
                   plate::truncate_to_width(canvas, map.title, plate::title_lettering(), width),
                   plate::title_lettering());
  for (std::size_t i = 0; i < map.notes.size(); ++i) {
    const double y = layout.text_top + 26 + kLine_px * static_cast<double>(i);
    canvas.draw_text(kMapMargin_px, y, plate::truncate_to_width(canvas, map.notes[i], plate::body_lettering(), width),
                     plate::body_lettering());
  }
  const std::string line = map.attribution.empty() ? "attribution: none in the tiles" : map.attribution;
  canvas.draw_text(kMapMargin_px, layout.height - kMapMargin_px + 6,
                   plate::truncate_to_width(canvas, line, plate::muted_lettering(12), width),
                   plate::muted_lettering(12));
}

void draw_over(Canvas& canvas, const PlaceMap& map, const MapPanel& panel) {
  canvas.clip(panel.frame.x, panel.frame.y, panel.frame.width, panel.frame.height);
  for (const MapOutline& outline : map.outlines) draw_outline(canvas, panel, outline);
  if (map.flight) draw_flight(canvas, panel, *map.flight);
  canvas.unclip();
}

}  // namespace

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

std::vector<DegreeTick> degree_ticks(const GroundExtent& extent, const geometry::LocalFrame& frame, bool meridians,
                                     int count) {
  const double length_m = meridians ? extent.width_m() : extent.height_m();
  // Longitudes are unwrapped around the middle one (date line).
  const auto place_at = [&](double along_m) {
    return frame.geodetic_from_local(meridians ? Vec3(extent.west + along_m, extent.north, 0)
                                               : Vec3(extent.east, extent.south + along_m, 0));
  };
  const double middle_deg = place_at(length_m / 2).longitude_deg;
  const auto degrees_at = [&](double along_m) {
    const geometry::Geodetic place = place_at(along_m);
    return meridians ? middle_deg + std::remainder(place.longitude_deg - middle_deg, 360.0) : place.latitude_deg;
  };
  const double low = degrees_at(0), high = degrees_at(length_m);
  std::vector<DegreeTick> ticks;
  if (!(high > low)) return ticks;  // at a pole
  const std::vector<double> values = nice_ticks(low, high, count);
  const double step = values.size() > 1 ? values[1] - values[0] : high - low;
  for (const double value : values) {
    double from_m = 0, to_m = length_m;
    for (int i = 0; i < 50; ++i) {
      const double middle_m = (from_m + to_m) / 2;
      (degrees_at(middle_m) < value ? from_m : to_m) = middle_m;
    }
    ticks.push_back({from_m, std::remainder(value, 360.0), step});
  }
  return ticks;
}

imaging::RgbImage draw_to_image(const PlaceMap& map) {
  const Layout layout = layout_of(map);
  Canvas canvas(static_cast<int>(layout.width), static_cast<int>(layout.height), plate::kBackground);
  draw_text(canvas, map, layout);
  const MapPanel picture{layout.picture, map.ground.extent}, heights{layout.heights, map.ground.extent};
  canvas.draw_image(picture.frame.x, picture.frame.y, on_hatched_paper(map.ground.colors, map.ground.heights_m));
  const Range range = shown_range(map.ground.heights_m);
  canvas.draw_image(heights.frame.x, heights.frame.y,
                    on_hatched_paper(height_picture(map.ground, range), map.ground.heights_m));
  for (const MapPanel& panel : {picture, heights}) {
    draw_grid(canvas, panel);
    draw_over(canvas, map, panel);
    draw_border(canvas, panel.frame);
  }
  if (map.frame) draw_degrees(canvas, picture, *map.frame);
  draw_scale_bar(canvas, picture);
  draw_north_arrow(canvas, picture);
  draw_height_bar(canvas, map, heights.frame, range);
  draw_legend(canvas, map, picture.frame.x, layout.legend_y);
  return canvas.image();
}

}  // namespace tileflight::drawing
