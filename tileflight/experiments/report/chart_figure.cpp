#include "tileflight/experiments/report/chart_figure.h"

#include <nlohmann/json.hpp>

namespace tileflight::report {

using drawing::Figure;

Figure chart_figure(const std::string& id, const drawing::Chart& chart, const std::string& caption) {
  const drawing::Drawing drawing = drawing::to_drawing(chart);
  Figure figure{id, "chart-figure", drawing::on_page(drawing), caption};
  figure.files = {{id + ".svg", "image/svg+xml", drawing::svg_file(chart.title, {drawing})},
                  {id + ".csv", "text/csv", drawing::to_csv(chart)}};
  figure.series = nlohmann::json::array();
  for (const drawing::ChartLine& line : chart.lines) {
    nlohmann::json points = nlohmann::json::array();
    for (const geometry::Vec2& p : line.points) points.push_back({p.x(), p.y()});
    figure.series.push_back({{"name", line.name}, {"x", chart.x.label}, {"y", chart.y.label}, {"points", points}});
  }
  return figure;
}

}  // namespace tileflight::report
