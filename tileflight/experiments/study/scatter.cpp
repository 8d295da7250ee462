#include "tileflight/experiments/study/scatter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "tileflight/core/drawing/number_format.h"

namespace tileflight::study {
namespace {

using drawing::element;
using drawing::empty_element;
using drawing::Html;
using drawing::svg_number;
using drawing::text;

// Units of the SVG's view box.
constexpr double kWidth = 560, kHeight = 330;
constexpr double kLeft = 74, kRight = 16, kTop = 14, kBottom = 46;
constexpr int kTicks = 6;
constexpr std::array kColors{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#a08f00", "#777777"};

/// An axis from data to the view box.
class Axis {
 public:
  Axis(bool logarithmic, double low_px, double high_px)
      : logarithmic_(logarithmic), low_px_(low_px), high_px_(high_px) {}

  bool can_show(double value) const { return std::isfinite(value) && (!logarithmic_ || value > 0.0); }
  void include(double value) {
    low_ = std::min(low_, scaled(value));
    high_ = std::max(high_, scaled(value));
  }
  /// Linear axes begin at zero; some room is left at the ends.
  void settle() {
    if (!logarithmic_) low_ = std::min(0.0, low_);
    if (!(high_ > low_)) high_ = low_ + 1.0;
    const double margin = 0.05 * (high_ - low_);
    high_ += margin;
    if (logarithmic_) low_ -= margin;
  }
  double to_px(double value) const { return low_px_ + (scaled(value) - low_) / (high_ - low_) * (high_px_ - low_px_); }
  std::vector<double> ticks() const {
    if (!logarithmic_) return linear_ticks(low_, high_);
    constexpr std::size_t kFewest = 3;
    const std::vector<double> values = logarithmic_ticks();
    return values.size() < kFewest ? linear_ticks(std::pow(10.0, low_), std::pow(10.0, high_)) : values;
  }

 private:
  static std::vector<double> linear_ticks(double low, double high) {
    std::vector<double> values;
    for (const double tick : drawing::nice_ticks(low, high, kTicks)) values.push_back(tick + 0.0);  // no "-0"
    return values;
  }
  /// 1, 2, 5, 10, …
  std::vector<double> logarithmic_ticks() const {
    std::vector<double> values;
    for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(std::ceil(high_)); ++power) {
      for (const double digit : {1.0, 2.0, 5.0}) {
        const double value = digit * std::pow(10.0, power);
        if (std::log10(value) >= low_ && std::log10(value) <= high_) values.push_back(value);
      }
    }
    return values;
  }
  double scaled(double value) const { return logarithmic_ ? std::log10(value) : value; }

  bool logarithmic_;
  double low_px_, high_px_;
  double low_ = std::numeric_limits<double>::infinity(), high_ = -std::numeric_limits<double>::infinity();
};

Html draw_axes(const Axis& across, const Axis& up, const Scatter& scatter) {
  Html result;
  for (const double tick : across.ticks()) {
    const double x = across.to_px(tick);
    result += drawing::svg_line(x, kHeight - kBottom, x, kHeight - kBottom + 5, "axis") +
              drawing::svg_label(x, kHeight - kBottom + 19, "middle", drawing::format_shortest(tick));
  }
  for (const double tick : up.ticks()) {
    const double y = up.to_px(tick);
    result += drawing::svg_line(kLeft, y, kWidth - kRight, y, "grid") +
              drawing::svg_label(kLeft - 7, y + 4, "end", drawing::format_shortest(tick));
  }
  result += drawing::svg_line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "axis");
  result += drawing::svg_label((kLeft + kWidth - kRight) / 2, kHeight - 8, "middle", scatter.x_label);
  const double middle = (kTop + kHeight - kBottom) / 2;
  return result + element("text",
                          {{"x", "14"},
                           {"y", svg_number(middle)},
                           {"text-anchor", "middle"},
                           {"transform", "rotate(-90 14 " + svg_number(middle) + ")"}},
                          text(scatter.y_label));
}

}  // namespace

drawing::Drawing to_drawing(const Scatter& scatter) {
  Axis across(scatter.x_is_logarithmic, kLeft, kWidth - kRight), up(scatter.y_is_logarithmic, kHeight - kBottom, kTop);
  std::vector<ScatterPoint> shown;
  for (const ScatterPoint& point : scatter.points) {
    if (!across.can_show(point.x) || !up.can_show(point.y)) continue;
    across.include(point.x);
    up.include(point.y);
    shown.push_back(point);
  }
  drawing::Drawing drawing{.width = kWidth, .height = kHeight, .style = "chart", .label = scatter.title, .content = {}};
  if (shown.empty()) return drawing;
  across.settle();
  up.settle();
  drawing.content = draw_axes(across, up, scatter);
  for (const ScatterPoint& point : shown) {
    drawing.content += element("circle",
                               {{"class", "point series-" + std::to_string(point.series % kColors.size())},
                                {"cx", svg_number(across.to_px(point.x))},
                                {"cy", svg_number(up.to_px(point.y))},
                                {"r", "5"}},
                               element("title", text(point.label)));
  }
  for (std::size_t i = 0; i < scatter.series.size(); ++i)
    drawing.legend.push_back({scatter.series[i], "line series-" + std::to_string(i % kColors.size())});
  return drawing;
}

std::string series_style() {
  std::string style = ".point { stroke: var(--paper); stroke-width: 1; opacity: .85; }\n";
  for (std::size_t i = 0; i < kColors.size(); ++i) {
    const std::string name = "series-" + std::to_string(i);
    style += ".point." + name + " { fill: " + kColors[i] + "; } .line." + name + " { stroke: " + kColors[i] +
             "; stroke-width: 8; }\n";
  }
  return style;
}

}  // namespace tileflight::study
