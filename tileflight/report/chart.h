#pragma once

#include <string>
#include <utility>
#include <vector>

#include "tileflight/geometry/transform.h"
#include "tileflight/report/drawing.h"

namespace tileflight::report {

/// A line of a chart, in the chart's own units. `style` is a class of the page's style sheet ("simulated", "real",
/// "floor", …).
struct ChartLine {
  std::string name;
  std::string style;
  std::vector<geometry::Vec2> points;
  bool filled = false;  ///< down to the x axis
};

/// A vertical line with its name, such as a mean.
struct ChartMark {
  std::string name;
  std::string style;
  double x = 0.0;
};

struct ChartAxis {
  std::string label;
  double low = 0.0, high = 1.0;
};

/// A chart with two linear axes.
struct Chart {
  std::string title;  ///< for those who cannot see it, with `description`
  std::string description;
  ChartAxis x, y;
  std::vector<ChartLine> lines;
  std::vector<ChartMark> marks;
};

Drawing drawing_of(const Chart& chart);
/// The lines' points, as drawn (RFC 4180): name, x, y.
std::string csv_of(const Chart& chart);

/// Points of a histogram's outline: the bins' edges with the share of each bin.
std::vector<geometry::Vec2> outline(const std::vector<double>& edges, const std::vector<double>& heights);

/// Points of the cumulative distribution of `values` over [0, limit], as a share of `total`, at most `steps` of them.
std::vector<geometry::Vec2> cumulative(std::vector<double> values, std::size_t total, double limit, int steps = 200);

}  // namespace tileflight::report
