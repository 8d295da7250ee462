#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/report.h"

namespace tileflight::report {
using drawing::display_width;

namespace {

std::string padded_left(const std::string& text, std::size_t width) {
  return std::string(width - std::min(width, display_width(text)), ' ') + text;
}
std::string padded_right(const std::string& text, std::size_t width) {
  return text + std::string(width - std::min(width, display_width(text)), ' ');
}

std::string without_trailing_spaces(std::string line) {
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

/// Widths of the label column and of every column of figures.
struct Widths {
  std::size_t label = 0;
  std::vector<std::size_t> columns;
};

Widths widths_of(const KeyFigures& figures) {
  Widths widths;
  for (const FlightColumn& column : figures.columns)
    widths.columns.push_back(std::max<std::size_t>(12, display_width(column.label)));
  for (const auto* rows : {&figures.as_published, &figures.additional}) {
    for (const KeyFigureRow& row : *rows) {
      widths.label = std::max(widths.label, display_width(row.label));
      for (std::size_t i = 0; i < row.cells.size(); ++i)
        widths.columns[i] = std::max(widths.columns[i], display_width(row.cells[i]));
    }
  }
  return widths;
}

std::string line(const std::string& label, const std::vector<std::string>& cells, const Widths& widths) {
  std::string result = padded_right(label, widths.label);
  for (std::size_t i = 0; i < cells.size(); ++i) result += "  " + padded_left(cells[i], widths.columns[i]);
  return without_trailing_spaces(result) + "\n";
}

}  // namespace

std::string results_table(const nlohmann::json& results) {
  const KeyFigures figures = key_figures(results);
  const Widths widths = widths_of(figures);
  std::vector<std::string> groups, labels;
  std::size_t total = widths.label;
  for (std::size_t i = 0; i < figures.columns.size(); ++i) {
    groups.push_back(figures.columns[i].published ? "paper" : "this run");
    labels.push_back(figures.columns[i].label);
    total += 2 + widths.columns[i];
  }
  const std::string rule = std::string(total, '-') + "\n";
  std::string table = line("", groups, widths) + line("", labels, widths) + rule;
  for (const KeyFigureRow& row : figures.as_published) table += line(row.label, row.cells, widths);
  table += rule;
  for (const KeyFigureRow& row : figures.additional) table += line(row.label, row.cells, widths);
  return table;
}

}  // namespace tileflight::report
