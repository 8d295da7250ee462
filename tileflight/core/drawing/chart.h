#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/drawing/drawing.h"
#include "tileflight/core/geometry/transform.h"

namespace tileflight::drawing {

/// A line of a chart, in data units. `style` is a class of the page's style sheet ("simulated", "real", "floor", …).
struct ChartLine {
  std::string name;
  std::string style;
  std::vector<geometry::Vec2> points;
  bool filled = false;  ///< the area down to the x axis is filled
};

/// A labelled vertical line, such as a mean.
struct ChartMark {
  std::string name;
  std::string style;
  double x = 0.0;
};

/// Label and range of an axis.
struct ChartAxis {
  std::string label;
  double low = 0.0, high = 1.0;
};

/// A chart with two linear axes.
struct Chart {
  std::string title;  ///< for screen readers, with `description`
  std::string description;
  ChartAxis x, y;
  std::vector<ChartLine> lines;
  std::vector<ChartMark> marks;
};

/// Draws the chart with axes, lines and legend.
Drawing to_drawing(const Chart& chart);
/// Returns the points of all lines as CSV (RFC 4180): name, x, y.
std::string to_csv(const Chart& chart);

/// Returns the outline of a histogram from the bins' edges and their shares.
std::vector<geometry::Vec2> histogram_outline(const std::vector<double>& edges, const std::vector<double>& heights);

/// Returns points of the cumulative distribution of `values` over [0, limit], as a share of `total`; at most `steps`
/// points.
std::vector<geometry::Vec2> cumulative_points(std::vector<double> values, std::size_t total, double limit,
                                              int steps = 200);

}  // namespace tileflight::drawing
