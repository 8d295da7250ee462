#include "tileflight/experiments/report/report_contents.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/ablation_table.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/map_comparison_tables.h"
#include "tileflight/experiments/report/score_tables.h"

namespace tileflight::report {
namespace {

using nlohmann::json;

/// Format version; increased when members change their meaning.
constexpr int kFormat = 1;

std::string name_of(const json& results) {
  const std::string name = drawing::text_at(results, "/name").value_or("");
  return name.empty() ? "Flight experiment" : name;
}

json json_of(const KeyFigures& figures) {
  json columns = json::array(), rows = json::array();
  for (const FlightColumn& column : figures.columns)
    columns.push_back({{"source", column.published ? "paper" : "run"}, {"flight", column.label}});
  for (const auto* part : {&figures.as_published, &figures.additional}) {
    for (const KeyFigureRow& row : *part) rows.push_back({{"figure", row.label}, {"cells", row.cells}});
  }
  return {{"columns", columns}, {"rows", rows}};
}

json json_of(const NamedTable& named) {
  const Table& table = named.table;
  return {{"id", named.id},
          {"caption", table.caption},
          {"groups", table.groups},
          {"head", table.header},
          {"rows", table.rows}};
}

json json_of(const drawing::Figure& figure) {
  json files = json::array();
  for (const drawing::FigureFile& file : figure.files) files.push_back("figures/" + file.name);
  return {{"id", figure.id}, {"caption", figure.caption}, {"files", files}, {"series", figure.series}};
}

}  // namespace

drawing::Figure ReportContents::figure(const std::string& id) const {
  const auto found = std::find_if(figures.begin(), figures.end(), [&](const drawing::Figure& f) { return f.id == id; });
  return found == figures.end() ? drawing::Figure{} : *found;
}

Table ReportContents::table(const std::string& id) const {
  const auto found = std::find_if(tables.begin(), tables.end(), [&](const NamedTable& t) { return t.id == id; });
  return found == tables.end() ? Table{} : found->table;
}

ReportContents build_contents(const RunFolder& run) {
  ReportContents contents;
  contents.name = name_of(run.results);
  contents.verdict = verdict(run.results);
  contents.remark_on_floor = remark_on_floor(run.results);
  contents.key_figures = key_figures(run.results);
  contents.missing = run.missing;
  contents.figures = {maps_figure(run),       histogram_figure(run), cumulative_figure(run), frames_figure(run),
                      error_maps_figure(run), paths_figure(run),     path_error_figure(run), overlap_figure(run)};
  std::erase_if(contents.figures, [](const drawing::Figure& figure) { return figure.empty(); });
  contents.tables = {{"percentiles", percentiles_table(run.flights)},
                     {"surface", surface_table(run.flights)},
                     {"quality", quality_table(run.flights)},
                     {"moving-objects", moving_table(run.flights)},
                     {"budget", budget_table(run.flights)},
                     {"verdict", map_comparison_table(run.results)},
                     {"missing-parts", missing_parts_table(run.results)},
                     {"comparison", comparison_table(run.results)},
                     {"runs", runs_table(run.flights)},
                     {"failure", failure_table(run.results)},
                     {"regions", regions_table(run.flights)},
                     {"parts", parts_table(run)},
                     {"trajectory", trajectory_table(run.flights)},
                     {"reproduction", reproduction_table(run.results)},
                     {"tracking", tracking_table(run.flights)},
                     {"ablation", ablation_table(run.results)},
                     {"place", place_table(run.results)},
                     {"coverage", coverage_table(run.coverage)}};
  std::erase_if(contents.tables, [](const NamedTable& named) { return named.table.rows.empty(); });
  return contents;
}

json report_json(const ReportContents& contents, const json& results) {
  json tables = json::array(), figures = json::array();
  for (const NamedTable& table : contents.tables) tables.push_back(json_of(table));
  for (const drawing::Figure& figure : contents.figures) figures.push_back(json_of(figure));
  return {{"format", kFormat},
          {"name", contents.name},
          {"verdict", contents.verdict},
          {"warnings", results.contains("warnings") ? results["warnings"] : json::array()},
          {"remark_on_floor", contents.remark_on_floor},
          {"key_figures", json_of(contents.key_figures)},
          {"tables", tables},
          {"figures", figures},
          {"missing", contents.missing},
          {"provenance", results.contains("provenance") ? results["provenance"] : json(nullptr)}};
}

}  // namespace tileflight::report
