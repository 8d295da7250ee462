#include "tileflight/experiments/report/key_figures_files.h"

#include <algorithm>
#include <array>
#include <string_view>
#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/drawing/number_format.h"

namespace tileflight::report {
namespace {

std::string csv_line(const std::string& label, const std::vector<std::string>& cells) {
  std::string line = base::csv_field(label);
  for (const std::string& cell : cells)
    line += ',' + (cell == drawing::kUnknown ? std::string() : base::csv_field(cell));
  return line + "\r\n";
}

std::string latex_line(const std::string& label, const std::vector<std::string>& cells) {
  std::string line = latex_text(label);
  for (const std::string& cell : cells) line += " & " + latex_text(cell);
  return line + " \\\\\n";
}

const char* source_of(const FlightColumn& column) { return column.published ? "Paper" : "This run"; }

/// Number of columns from `first` on with the same source.
std::size_t group_size(const std::vector<FlightColumn>& columns, std::size_t first) {
  std::size_t last = first;
  while (last < columns.size() && columns[last].published == columns[first].published) ++last;
  return last - first;
}

/// Sources above their columns, with rules below them.
std::string latex_groups(const std::vector<FlightColumn>& columns) {
  std::string names, rules;
  for (std::size_t first = 0; first < columns.size(); first += group_size(columns, first)) {
    const std::size_t size = group_size(columns, first);
    names += " & \\multicolumn{" + std::to_string(size) + "}{c}{" + source_of(columns[first]) + "}";
    rules += "\\cmidrule(lr){" + std::to_string(first + 2) + "-" + std::to_string(first + size + 1) + "}\n";
  }
  return names.empty() ? "" : names + " \\\\\n" + rules;
}

}  // namespace

std::string latex_text(const std::string& plain) {
  static constexpr std::array<std::pair<std::string_view, std::string_view>, 15> kCommands{{
      {"\\", "\\textbackslash{}"},
      {"&", "\\&"},
      {"%", "\\%"},
      {"$", "\\$"},
      {"#", "\\#"},
      {"_", "\\_"},
      {"{", "\\{"},
      {"}", "\\}"},
      {"~", "\\textasciitilde{}"},
      {"^", "\\textasciicircum{}"},
      {"\u00A0", "~"},
      {"\u00B0", "$^{\\circ}$"},
      {"\u00D7", "$\\times$"},
      {"\u2212", "$-$"},
      {"\u2013", "--"},
  }};
  std::string result;
  for (std::string_view rest = plain; !rest.empty();) {
    const auto* const command =
        std::find_if(kCommands.begin(), kCommands.end(), [&](const auto& c) { return rest.starts_with(c.first); });
    result += command == kCommands.end() ? rest.substr(0, 1) : command->second;
    rest.remove_prefix(command == kCommands.end() ? 1 : command->first.size());
  }
  return result;
}

std::string key_figures_csv(const KeyFigures& figures) {
  std::vector<std::string> names;
  for (const FlightColumn& column : figures.columns)
    names.push_back(std::string(source_of(column)) + ": " + column.label);
  std::string csv = csv_line("Figure", names);
  for (const auto* rows : {&figures.as_published, &figures.additional}) {
    for (const KeyFigureRow& row : *rows) csv += csv_line(row.label, row.cells);
  }
  return csv;
}

std::string key_figures_latex(const KeyFigures& figures) {
  std::vector<std::string> labels;
  for (const FlightColumn& column : figures.columns) labels.push_back(column.label);
  std::string table = "% needs \\usepackage{booktabs}\n\\begin{tabular}{l" + std::string(labels.size(), 'r') +
                      "}\n\\toprule\n" + latex_groups(figures.columns) + latex_line("", labels);
  for (const auto* rows : {&figures.as_published, &figures.additional}) {
    table += "\\midrule\n";
    for (const KeyFigureRow& row : *rows) table += latex_line(row.label, row.cells);
  }
  return table + "\\bottomrule\n\\end{tabular}\n";
}

void write_key_figures(const std::filesystem::path& folder, const KeyFigures& figures) {
  std::error_code error;  // ignored: writing the file reports the error
  std::filesystem::create_directories(folder, error);
  base::write_file(folder / "key-figures.csv", key_figures_csv(figures));
  base::write_file(folder / "key-figures.tex", key_figures_latex(figures));
}

}  // namespace tileflight::report
