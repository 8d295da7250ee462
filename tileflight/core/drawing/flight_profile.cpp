#include "tileflight/core/drawing/flight_profile.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/raster_figure.h"

namespace tileflight::drawing {
namespace {

using geometry::Vec2;
using plate::PlotArea;
using plate::Side;

constexpr double kWidth_px = 1200, kMargin_px = 26, kLeft_px = 84, kRight_px = 26, kPanel_px = 250, kGap_px = 96;
constexpr int kProfileTicks = 10;
constexpr Ink kCamera{0.05, 0.25, 0.85, 1.0}, kGround{0.52, 0.44, 0.36, 1.0}, kClearance{0.90, 0.45, 0.00, 1.0};

/// Axes of a panel; the horizontal one is the path length.
struct Panel {
  PlotArea frame;
  plate::AxisScale along, up;
  Vec2 at(double along_m, double value) const { return {along.to_px(along_m), up.to_px(value)}; }
};

std::pair<double, double> range_of(const std::vector<std::vector<double>>& lists) {
  double low = INFINITY, high = -INFINITY;
  for (const std::vector<double>& values : lists) {
    for (const double value : values) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, value);
      high = std::max(high, value);
    }
  }
  return low <= high ? std::pair(low, high) : std::pair(0.0, 1.0);
}

Panel panel_of(const FlightProfile& p, double y, double low, double high) {
  const double spread = std::max(1.0, high - low);
  const PlotArea frame{kMargin_px + kLeft_px, y, kWidth_px - 2 * kMargin_px - kLeft_px - kRight_px, kPanel_px};
  const double length_m = p.distance_flown_m.empty() ? 1.0 : std::max(1e-3, p.distance_flown_m.back());
  return {frame, {0.0, length_m, frame.x, frame.right()}, {low, high + 0.08 * spread, frame.bottom(), frame.y}};
}

/// Contiguous runs of finite values.
std::vector<std::vector<Vec2>> runs_of(const Panel& panel, const std::vector<double>& along_m,
                                       const std::vector<double>& values) {
  std::vector<std::vector<Vec2>> runs(1);
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (std::isfinite(values[i])) {
      runs.back().push_back(panel.at(along_m[i], values[i]));
    } else if (!runs.back().empty()) {
      runs.emplace_back();
    }
  }
  return runs;
}

void draw_line(Canvas& canvas, const Panel& panel, const std::vector<double>& along_m,
               const std::vector<double>& values, const Stroke& stroke) {
  for (const auto& run : runs_of(panel, along_m, values)) {
    if (run.size() == 1) canvas.fill_disc(run.front(), stroke.width_px, stroke.ink);
    if (run.size() > 1) canvas.draw_line(run, stroke);
  }
}

void draw_ground(Canvas& canvas, const Panel& panel, const std::vector<double>& along_m,
                 const std::vector<double>& ground_m) {
  for (auto run : runs_of(panel, along_m, ground_m)) {
    if (run.size() < 2) continue;
    canvas.draw_line(run, {kGround, 2.0, {}});
    run.emplace_back(run.back().x(), panel.frame.bottom());
    run.emplace_back(run.front().x(), panel.frame.bottom());
    canvas.fill_polygon(run, {kGround.red, kGround.green, kGround.blue, 0.30});
  }
}

void draw_grid(Canvas& canvas, const Panel& panel, const std::string& label, bool with_label) {
  const auto across = plate::make_ticks(panel.along, kProfileTicks), up = plate::make_ticks(panel.up, 5);
  for (const plate::Tick& tick : up)
    canvas.draw_line({{panel.frame.x, tick.at_px}, {panel.frame.right(), tick.at_px}}, {plate::kGridline, 1.0, {}});
  draw_axis(canvas, panel.frame, Side::kLeft, up, label);
  draw_axis(canvas, panel.frame, Side::kBottom, across, with_label ? "distance flown, m" : "");
}

/// Draws times at the corresponding path lengths.
void draw_times(Canvas& canvas, const Panel& panel, const FlightProfile& p) {
  if (p.time_s.size() < 2) return;
  std::vector<plate::Tick> ticks = plate::make_ticks({0.0, p.time_s.back(), 0.0, p.time_s.back()}, kProfileTicks);
  for (plate::Tick& tick : ticks) {
    const auto next = std::lower_bound(p.time_s.begin(), p.time_s.end(), tick.at_px - 1e-9);
    const auto i = static_cast<std::size_t>(std::min(next, p.time_s.end() - 1) - p.time_s.begin());
    tick.at_px = panel.along.to_px(p.distance_flown_m[i]);
  }
  draw_axis(canvas, panel.frame, Side::kTop, ticks, "time, s");
}

void draw_collisions(Canvas& canvas, const Panel& panel, const FlightProfile& p, const std::vector<double>& values) {
  for (std::size_t i = 0; i < p.in_collision.size(); ++i) {
    const double value = std::isfinite(values[i]) ? values[i] : panel.up.low;
    if (p.in_collision[i]) canvas.fill_disc(panel.at(p.distance_flown_m[i], value), 4.0, plate::kWarning);
  }
}

struct Entry {
  std::string name;
  Stroke stroke;
};

void draw_legend(Canvas& canvas, const Panel& panel, const std::vector<Entry>& entries) {
  double x = panel.frame.x + 12;
  const double y = panel.frame.y + 20;
  for (const Entry& entry : entries) {
    canvas.draw_line({{x, y - 5}, {x + 26, y - 5}}, entry.stroke);
    canvas.draw_text(x + 33, y, entry.name, plate::overlay_lettering(13));
    x += 33 + canvas.text_width(entry.name, plate::overlay_lettering(13)) + 24;
  }
}

void draw_heights(Canvas& canvas, const FlightProfile& p, double y) {
  std::vector<double> ground_m;
  for (std::size_t i = 0; i < p.up_m.size(); ++i) ground_m.push_back(p.up_m[i] - p.above_ground_m[i]);
  const auto [low, high] = range_of({p.up_m, ground_m});
  const double below = 0.06 * std::max(1.0, high - low), legend = 0.12 * std::max(1.0, high - low);
  const Panel panel = panel_of(p, y, low - below, high + legend);
  draw_grid(canvas, panel, "up, m (local frame)", false);
  draw_times(canvas, panel, p);
  canvas.clip(panel.frame.x, panel.frame.y, panel.frame.width, panel.frame.height);
  draw_ground(canvas, panel, p.distance_flown_m, ground_m);
  draw_line(canvas, panel, p.distance_flown_m, p.up_m, {kCamera, 2.4, {}});
  draw_collisions(canvas, panel, p, p.up_m);
  canvas.unclip();
  draw_border(canvas, panel.frame);
  draw_legend(canvas, panel, {{"camera", {kCamera, 2.4, {}}}, {"highest surface below it", {kGround, 2.4, {}}}});
}

void draw_clearance(Canvas& canvas, const FlightProfile& p, double y) {
  std::vector<double> clearance_m;
  for (const double value : p.clearance_m) clearance_m.push_back(std::isfinite(value) ? value : p.max_clearance_m);
  const auto [low, high] = range_of({p.above_ground_m, clearance_m, {0.0, 2 * p.min_clearance_m}});
  const Panel panel = panel_of(p, y, std::min(0.0, low), high + 0.12 * (high - low));
  draw_grid(canvas, panel, "m", true);
  canvas.clip(panel.frame.x, panel.frame.y, panel.frame.width, panel.frame.height);
  canvas.fill_rectangle(panel.frame.x, panel.up.to_px(p.min_clearance_m), panel.frame.width,
                        panel.up.to_px(0.0) - panel.up.to_px(p.min_clearance_m),
                        {plate::kWarning.red, plate::kWarning.green, plate::kWarning.blue, 0.13});
  draw_line(canvas, panel, p.distance_flown_m, p.above_ground_m, {kGround, 2.2, {}});
  draw_line(canvas, panel, p.distance_flown_m, clearance_m, {kClearance, 2.2, {}});
  draw_collisions(canvas, panel, p, clearance_m);
  canvas.unclip();
  draw_border(canvas, panel.frame);
  draw_legend(canvas, panel,
              {{"height above the surface below", {kGround, 2.2, {}}},
               {"distance to the nearest surface", {kClearance, 2.2, {}}},
               {"nearer than " + format_shortest(p.min_clearance_m) + " m",
                {{plate::kWarning.red, plate::kWarning.green, plate::kWarning.blue, 0.35}, 10.0, {}}}});
}

}  // namespace

imaging::RgbImage draw_to_image(const FlightProfile& p) {
  const double head = kMargin_px + 44 + 20 * static_cast<double>(p.notes.size()) + 34;
  const double second = head + kPanel_px + kGap_px - 40;
  Canvas canvas(static_cast<int>(kWidth_px), static_cast<int>(second + kPanel_px + 56 + kMargin_px),
                plate::kBackground);
  const double width = kWidth_px - 2 * kMargin_px;
  canvas.draw_text(kMargin_px, kMargin_px + 22,
                   plate::truncate_to_width(canvas, p.title, plate::title_lettering(), width),
                   plate::title_lettering());
  for (std::size_t i = 0; i < p.notes.size(); ++i) {
    canvas.draw_text(kMargin_px, kMargin_px + 48 + 20 * static_cast<double>(i),
                     plate::truncate_to_width(canvas, p.notes[i], plate::body_lettering(), width),
                     plate::body_lettering());
  }
  draw_heights(canvas, p, head);
  draw_clearance(canvas, p, second);
  return canvas.image();
}

}  // namespace tileflight::drawing
