#include "tileflight/core/drawing/raster_figure.h"

#include <cmath>
#include <numbers>
#include <sstream>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::drawing::plate {

namespace {

constexpr double kMark_px = 5.0, kGap_px = 4.0, kText_px = 13.0;

bool is_upright(Side side) { return side == Side::kLeft || side == Side::kRight; }

void draw_mark(Canvas& canvas, const PlotArea& f, Side side, double at) {
  const Stroke stroke{kInk, 1.0, {}};
  if (side == Side::kBottom) canvas.draw_line({{at, f.bottom()}, {at, f.bottom() + kMark_px}}, stroke);
  if (side == Side::kTop) canvas.draw_line({{at, f.y - kMark_px}, {at, f.y}}, stroke);
  if (side == Side::kLeft) canvas.draw_line({{f.x - kMark_px, at}, {f.x, at}}, stroke);
  if (side == Side::kRight) canvas.draw_line({{f.right(), at}, {f.right() + kMark_px, at}}, stroke);
}

void draw_text(Canvas& canvas, const PlotArea& f, Side side, const Tick& tick) {
  TextStyle style = body_lettering(kText_px);
  const double beyond = kMark_px + kGap_px, half = 0.36 * kText_px;
  style.anchor = TextAnchor::kMiddle;
  if (side == Side::kBottom) canvas.draw_text(tick.at_px, f.bottom() + beyond + kText_px - 2, tick.text, style);
  if (side == Side::kTop) canvas.draw_text(tick.at_px, f.y - beyond, tick.text, style);
  style.anchor = side == Side::kLeft ? TextAnchor::kEnd : TextAnchor::kStart;
  if (side == Side::kLeft) canvas.draw_text(f.x - beyond, tick.at_px + half, tick.text, style);
  if (side == Side::kRight) canvas.draw_text(f.right() + beyond, tick.at_px + half, tick.text, style);
}

void draw_label(Canvas& canvas, const PlotArea& f, Side side, double widest_px, const std::string& label) {
  TextStyle style = muted_lettering();
  style.anchor = TextAnchor::kMiddle;
  const double middle_x = f.x + f.width / 2, middle_y = f.y + f.height / 2;
  const double beyond = kMark_px + 2 * kGap_px;
  if (side == Side::kBottom) canvas.draw_text(middle_x, f.bottom() + beyond + 2 * kText_px + 4, label, style);
  if (side == Side::kTop) canvas.draw_text(middle_x, f.y - beyond - kText_px - 2, label, style);
  style.rotation_rad = -std::numbers::pi / 2;
  if (side == Side::kLeft) canvas.draw_text(f.x - beyond - widest_px - 4, middle_y, label, style);
  style.rotation_rad = std::numbers::pi / 2;
  if (side == Side::kRight) canvas.draw_text(f.right() + beyond + widest_px + 4, middle_y, label, style);
}

/// Removes the last character (UTF-8: bytes that begin with the bits 10 continue a character).
std::string without_last(std::string text) {
  while (!text.empty() && (static_cast<unsigned char>(text.back()) & 0xC0U) == 0x80U) text.pop_back();
  if (!text.empty()) text.pop_back();
  return text;
}

}  // namespace

TextStyle body_lettering(double size_px) { return {.size_px = size_px, .ink = kInk, .halo = std::nullopt}; }
TextStyle muted_lettering(double size_px) { return {.size_px = size_px, .ink = kMuted, .halo = std::nullopt}; }
TextStyle title_lettering() { return {.size_px = 22.0, .ink = kInk, .bold = true, .halo = std::nullopt}; }
TextStyle overlay_lettering(double size_px) { return {.size_px = size_px, .ink = kInk, .bold = true, .halo = kHalo}; }

std::vector<Tick> make_ticks(const AxisScale& scale, int count) {
  const std::vector<double> values = nice_ticks(scale.low, scale.high, count);
  const double step = values.size() > 1 ? values[1] - values[0] : 1.0;
  std::vector<Tick> ticks;
  for (const double value : values) {
    std::string text = tick_text(value, step);
    if (text.starts_with('-')) text = "\u2212" + text.substr(1);
    ticks.push_back({scale.to_px(value), text});
  }
  return ticks;
}

void draw_axis(Canvas& canvas, const PlotArea& frame, Side side, const std::vector<Tick>& ticks,
               const std::string& label) {
  double widest_px = 0, taken_from = INFINITY, taken_to = -INFINITY;  // interval covered by the last text
  for (const Tick& tick : ticks) {
    draw_mark(canvas, frame, side, tick.at_px);
    const double width_px = canvas.text_width(tick.text, body_lettering(kText_px));
    widest_px = std::max(widest_px, width_px);
    const double half = is_upright(side) ? 0.6 * kText_px : width_px / 2 + kGap_px;
    if (tick.at_px - half < taken_to && tick.at_px + half > taken_from) continue;
    draw_text(canvas, frame, side, tick);
    taken_from = tick.at_px - half;
    taken_to = tick.at_px + half;
  }
  if (!label.empty()) draw_label(canvas, frame, side, widest_px, label);
}

void draw_border(Canvas& canvas, const PlotArea& f) {
  canvas.draw_line({{f.x, f.y}, {f.right(), f.y}, {f.right(), f.bottom()}, {f.x, f.bottom()}}, {kInk, 1.0, {}}, true);
}

std::string truncate_to_width(const Canvas& canvas, const std::string& text, const TextStyle& lettering,
                              double width_px) {
  if (canvas.text_width(text, lettering) <= width_px) return text;
  std::string cut = without_last(text);
  while (!cut.empty() && canvas.text_width(cut + "\u2026", lettering) > width_px) cut = without_last(std::move(cut));
  return cut + "\u2026";
}

}  // namespace tileflight::drawing::plate
