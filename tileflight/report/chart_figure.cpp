#include "tileflight/report/chart_figure.h"

#include <nlohmann/json.hpp>

namespace tileflight::report {

Figure chart_figure(const std::string& id, const Chart& chart, const std::string& caption) {
  const Drawing drawing = to_drawing(chart);
  Figure figure{id, "chart-figure", on_page(drawing), caption};
  figure.files = {{id + ".svg", "image/svg+xml", svg_file(chart.title, {drawing})},
                  {id + ".csv", "text/csv", to_csv(chart)}};
  figure.series = nlohmann::json::array();
  for (const ChartLine& line : chart.lines) {
    nlohmann::json points = nlohmann::json::array();
    for (const geometry::Vec2& p : line.points) points.push_back({p.x(), p.y()});
    figure.series.push_back({{"name", line.name}, {"x", chart.x.label}, {"y", chart.y.label}, {"points", points}});
  }
  return figure;
}

}  // namespace tileflight::report
