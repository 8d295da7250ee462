#include "tileflight/core/drawing/chart.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/drawing/drawing.h"
#include "tileflight/core/drawing/number_format.h"

namespace tileflight::drawing {
namespace {

using geometry::Vec2;

// Units of the SVG's view box; the page scales it to the column width.
constexpr double kWidth = 560, kHeight = 330;
constexpr double kLeft = 58, kRight = 14, kTop = 14, kBottom = 46;
constexpr int kTicks = 6;

/// Mapping from data units to the view box.
struct Frame {
  ChartAxis x, y;

  double across(double value) const { return kLeft + (value - x.low) / (x.high - x.low) * (kWidth - kLeft - kRight); }
  double down(double value) const {
    return kHeight - kBottom - (value - y.low) / (y.high - y.low) * (kHeight - kTop - kBottom);
  }
};

double step_of(const std::vector<double>& ticks) { return ticks.size() > 1 ? ticks[1] - ticks[0] : 1.0; }

Html axes(const Frame& frame) {
  Html result;
  const std::vector<double> across = nice_ticks(frame.x.low, frame.x.high, kTicks),
                            up = nice_ticks(frame.y.low, frame.y.high, kTicks);
  for (const double tick : across) {
    const double x = frame.across(tick);
    result += svg_line(x, kHeight - kBottom, x, kHeight - kBottom + 5, "axis") +
              svg_label(x, kHeight - kBottom + 19, "middle", tick_text(tick, step_of(across)));
  }
  for (const double tick : up) {
    const double y = frame.down(tick);
    result += svg_line(kLeft, y, kWidth - kRight, y, "grid") +
              svg_label(kLeft - 7, y + 4, "end", tick_text(tick, step_of(up)));
  }
  result += svg_line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "axis");
  result += svg_label((kLeft + kWidth - kRight) / 2, kHeight - 8, "middle", frame.x.label);
  const double middle = (kTop + kHeight - kBottom) / 2;
  result += element("text",
                    {{"x", "14"},
                     {"y", svg_number(middle)},
                     {"text-anchor", "middle"},
                     {"transform", "rotate(-90 14 " + svg_number(middle) + ")"}},
                    text(frame.y.label));
  return result;
}

std::string path_through(const Frame& frame, const std::vector<Vec2>& points) {
  std::string path;
  for (const Vec2& p : points) {
    path += (path.empty() ? "M" : "L") + svg_number(frame.across(p.x())) + " " + svg_number(frame.down(p.y()));
  }
  return path;
}

Html draw_line(const Frame& frame, const ChartLine& series) {
  if (series.points.empty()) return {};
  const std::string path = path_through(frame, series.points);
  Html result;
  if (series.filled) {
    const std::string base = svg_number(frame.down(frame.y.low));
    const std::string closed = path + "L" + svg_number(frame.across(series.points.back().x())) + " " + base + "L" +
                               svg_number(frame.across(series.points.front().x())) + " " + base + "Z";
    result += empty_element("path", {{"d", closed}, {"class", "area " + series.style}});
  }
  return result + empty_element("path", {{"d", path}, {"class", "line " + series.style}});
}

Html draw_mark(const Frame& frame, const ChartMark& mark) {
  const double x = frame.across(std::clamp(mark.x, frame.x.low, frame.x.high));
  return svg_line(x, kTop, x, kHeight - kBottom, "mark " + mark.style);
}

std::vector<LegendEntry> legend_of(const Chart& chart) {
  std::vector<LegendEntry> entries;
  for (const ChartLine& series : chart.lines) entries.push_back({series.name, "line " + series.style});
  for (const ChartMark& mark : chart.marks) entries.push_back({mark.name, "mark " + mark.style});
  return entries;
}

}  // namespace

Drawing to_drawing(const Chart& chart) {
  const Frame frame{chart.x, chart.y};
  Html content = element("title", text(chart.title)) + element("desc", text(chart.description)) + axes(frame);
  for (const ChartLine& series : chart.lines) content += draw_line(frame, series);
  for (const ChartMark& mark : chart.marks) content += draw_mark(frame, mark);
  return {kWidth, kHeight, "chart", chart.title + ". " + chart.description, content, legend_of(chart)};
}

std::string to_csv(const Chart& chart) {
  std::vector<std::vector<std::string>> lines{{"line", chart.x.label, chart.y.label}};
  for (const ChartLine& series : chart.lines) {
    for (const Vec2& p : series.points) lines.push_back({series.name, format_shortest(p.x()), format_shortest(p.y())});
  }
  return to_csv(lines);
}

std::vector<geometry::Vec2> histogram_outline(const std::vector<double>& edges, const std::vector<double>& heights) {
  std::vector<Vec2> points;
  for (std::size_t i = 0; i < heights.size() && i + 1 < edges.size(); ++i) {
    points.emplace_back(edges[i], heights[i]);
    points.emplace_back(edges[i + 1], heights[i]);
  }
  return points;
}

std::vector<geometry::Vec2> cumulative_points(std::vector<double> values, std::size_t total, double limit, int steps) {
  std::sort(values.begin(), values.end());
  std::vector<Vec2> points;
  for (int i = 0; i <= steps; ++i) {
    const double at = limit * i / steps;
    const auto below = std::upper_bound(values.begin(), values.end(), at) - values.begin();
    points.emplace_back(at, total > 0 ? static_cast<double>(below) / static_cast<double>(total) : 0.0);
  }
  return points;
}

}  // namespace tileflight::drawing
