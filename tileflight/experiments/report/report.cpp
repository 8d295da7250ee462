#include "tileflight/experiments/report/report.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/drawing/figure.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/ablation_table.h"
#include "tileflight/experiments/report/figures.h"
#include "tileflight/experiments/report/key_figures.h"
#include "tileflight/experiments/report/map_comparison_tables.h"
#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/experiments/report/score_tables.h"
#include "tileflight/experiments/report/tables.h"
#include "tileflight/experiments/report/view_data.h"
#include "tileflight/experiments/report/warnings_panel.h"

namespace tileflight::report {

namespace {

/// A table with its id.
struct NamedTable {
  std::string id;
  Table table;
};

/// Content of a report, independent of whether it is put on a page or in files.
struct ReportContents {
  std::string name, verdict, remark_on_floor;
  KeyFigures key_figures;
  std::vector<drawing::Figure> figures;  ///< only those with data
  std::vector<NamedTable> tables;        ///< only those with data
  std::vector<std::string> missing;

  /// The figure or table with this id; empty if the run has no data for it.
  drawing::Figure figure(const std::string& id) const;
  Table table(const std::string& id) const;
};

/// report.json (docs/report.md): all numbers of the page in machine-readable form.
nlohmann::json report_json(const ReportContents& contents, const nlohmann::json& results);

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

drawing::Figure ReportContents::figure(const std::string& id) const {
  const auto found = std::find_if(figures.begin(), figures.end(), [&](const drawing::Figure& f) { return f.id == id; });
  return found == figures.end() ? drawing::Figure{} : *found;
}

Table ReportContents::table(const std::string& id) const {
  const auto found = std::find_if(tables.begin(), tables.end(), [&](const NamedTable& t) { return t.id == id; });
  return found == tables.end() ? Table{} : found->table;
}

/// Builds all figures, tables and texts of a run.
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

/// A section of the page below the first screen.
struct Section {
  std::string id, title;
  drawing::Html content;
};

/// Arranges content side by side if there is room; empty for empty content.
drawing::Html columns(const drawing::Html& content) {
  return content.empty() ? drawing::Html() : drawing::element("div", {{"class", "columns"}}, content);
}

/// Links to the files beside the page.
drawing::Html files_list(const ReportContents& contents) {
  std::vector<std::string> names{"report.json", "results.json", "tables/key-figures.csv", "tables/key-figures.tex"};
  for (const drawing::Figure& figure : contents.figures) {
    for (const drawing::FigureFile& file : figure.files) names.push_back("figures/" + file.name);
  }
  drawing::Html items;
  for (const std::string& name : names)
    items += drawing::element("li", drawing::element("a", {{"href", name}}, drawing::text(name)));
  return drawing::element("p", drawing::text("Files in this page's folder:")) +
         drawing::element("ul", {{"class", "files"}}, items);
}

/// Sections in reading order; empty ones are left out.
std::vector<Section> sections_of(const RunFolder& run, const ReportContents& c, const ReportOptions& options) {
  const auto figure = [&](const char* id) { return to_html(c.figure(id)); };
  const auto table = [&](const char* id) { return to_html(c.table(id)); };
  std::vector<Section> sections{
      {"view", "The place, the maps and the flights", view_section(run, options.view)},
      {"errors", "Map error",
       columns(figure("error-histogram") + figure("error-cumulative")) + table("percentiles") + table("surface") +
           table("quality") + table("moving-objects") + table("budget")},
      {"comparison", "Simulated against second flight",
       table("verdict") + table("missing-parts") + table("comparison") + table("runs") + table("failure")},
      {"frames", "Images of the flights", figure("frames")},
      {"error-maps", "Error by location", figure("error-maps") + table("parts") + table("regions")},
      {"paths", "Paths",
       columns(figure("paths") + figure("path-error")) + table("trajectory") + table("reproduction") +
           columns(figure("view-overlap"))},
      {"tracking", "Odometry and alignment", table("tracking")},
      {"ablation", "Variants of the simulated flight", table("ablation")},
      {"place", "Coverage of the place", table("place") + table("coverage")},
      {"provenance", "Provenance of the numbers",
       drawing::element("div", {{"class", "provenance"}}, provenance_tables(run.results))},
      {"files", "Files", files_list(c)}};
  std::erase_if(sections, [](const Section& section) { return section.content.empty(); });
  return sections;
}

drawing::Html navigation(const std::vector<Section>& sections) {
  drawing::Html items;
  for (const Section& section : sections)
    items += drawing::element("li", drawing::element("a", {{"href", "#" + section.id}}, drawing::text(section.title)));
  return drawing::element("nav", {{"aria-label", "Sections"}}, drawing::element("ul", items));
}

drawing::Html notice(const std::vector<std::string>& missing) {
  if (missing.empty()) return {};
  drawing::Html items;
  for (const std::string& line : missing) items += drawing::element("li", drawing::text(line));
  return drawing::element("div", {{"class", "notice"}},
                          drawing::text("Not shown because data are missing:") + drawing::element("ul", items));
}

std::string second_flight_note(const nlohmann::json& results) {
  const std::string kind = drawing::text_at(results, "/real/kind").value_or("");
  if (kind != "surrogate") return "";
  return " The second flight is a surrogate: not the video of a real flight but rendered, with a camera degraded on "
         "purpose.";
}

drawing::Html floor_note(const std::string& remark) {
  return remark.empty() ? drawing::Html() : drawing::element("p", {{"class", "note"}}, drawing::text(remark));
}

drawing::Html header(const RunFolder& run, const ReportContents& contents, const std::vector<Section>& sections) {
  const std::string subtitle =
      "A simulated and a second flight over the same place, mapped by visual odometry and scored against ground truth "
      "from 3D Tiles." +
      second_flight_note(run.results);
  return drawing::element("header", drawing::element("h1", drawing::text(contents.name)) +
                                        drawing::element("p", {{"class", "subtitle"}}, drawing::text(subtitle)) +
                                        drawing::element("p", {{"class", "verdict"}}, drawing::text(contents.verdict)) +
                                        warnings_panel(run.results) + navigation(sections));
}

drawing::Html main_part(const ReportContents& contents, const std::vector<Section>& sections) {
  drawing::Html parts = drawing::element(
      "section", {{"class", "first-screen"}, {"aria-label", "Key figures"}},
      drawing::element("div", key_figures_table(contents.key_figures) + floor_note(contents.remark_on_floor)) +
          to_html(contents.figure("maps")));
  for (const Section& section : sections) {
    parts += drawing::element(
        "section", {{"id", section.id}, {"aria-labelledby", section.id + "-title"}},
        drawing::element("h2", {{"id", section.id + "-title"}}, drawing::text(section.title)) + section.content);
  }
  return drawing::element("main", {{"id", "main"}}, parts + notice(contents.missing));
}

drawing::Html body(const RunFolder& run, const ReportContents& contents, const ReportOptions& options) {
  const std::vector<Section> sections = sections_of(run, contents, options);
  const drawing::Html skip =
      drawing::element("a", {{"class", "skip"}, {"href", "#main"}}, drawing::text("Skip to the results"));
  const drawing::Html footer = drawing::element(
      "footer",
      drawing::text("Made by tileflight. Published figures: Beam et al., Cesium Tiles for High-realism Simulation and "
                    "Comparing SLAM Results in Corresponding Virtual and Real-world Environments."));
  return drawing::element(
      "body", skip + header(run, contents, sections) + main_part(contents, sections) + footer + view_script());
}

}  // namespace

void write_report(const std::filesystem::path& run_folder, const ReportOptions& options) {
  const RunFolder run = read_run_folder(run_folder);
  const ReportContents contents = build_contents(run);
  const drawing::Html page =
      drawing::element("html", {{"lang", "en"}}, page_head(contents.name) + body(run, contents, options));
  const nlohmann::json numbers = report_json(contents, run.results);
  base::write_file(run_folder / "report.html", "<!DOCTYPE html>\n" + page.str() + "\n");
  base::write_file(run_folder / "report.json",
                   numbers.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  drawing::write_figures(run_folder / "figures", contents.figures);
  write_key_figures(run_folder / "tables", contents.key_figures);
}

}  // namespace tileflight::report
