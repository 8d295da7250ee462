#include "tileflight/experiments/report/report.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/drawing/drawing.h"
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

using drawing::element;
using drawing::Figure;
using drawing::FigureFile;
using drawing::Html;
using drawing::text;
using drawing::text_at;

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
  std::vector<Figure> figures;     ///< only those with data
  std::vector<NamedTable> tables;  ///< only those with data
  std::vector<std::string> missing;

  /// The figure or table with this id; empty if the run has no data for it.
  Figure figure(const std::string& id) const;
  Table table(const std::string& id) const;
};

using nlohmann::json;

/// Format version; increased when members change their meaning.
constexpr int kFormat = 1;

std::string name_of(const json& results) {
  const std::string name = text_at(results, "/name").value_or("");
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

json json_of(const Figure& figure) {
  json files = json::array();
  for (const FigureFile& file : figure.files) files.push_back("figures/" + file.name);
  return {{"id", figure.id}, {"caption", figure.caption}, {"files", files}, {"series", figure.series}};
}

Figure ReportContents::figure(const std::string& id) const {
  const auto found = std::find_if(figures.begin(), figures.end(), [&](const Figure& f) { return f.id == id; });
  return found == figures.end() ? Figure{} : *found;
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
  std::erase_if(contents.figures, [](const Figure& figure) { return figure.empty(); });
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

/// report.json (docs/report.md): all numbers of the page in machine-readable form.
json report_json(const ReportContents& contents, const json& results) {
  json tables = json::array(), figures = json::array();
  for (const NamedTable& table : contents.tables) tables.push_back(json_of(table));
  for (const Figure& figure : contents.figures) figures.push_back(json_of(figure));
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
  Html content;
};

/// Arranges content side by side if there is room; empty for empty content.
Html columns(const Html& content) { return content.empty() ? Html() : element("div", {{"class", "columns"}}, content); }

/// Links to the files beside the page.
Html files_list(const ReportContents& contents) {
  std::vector<std::string> names{"report.json", "results.json", "tables/key-figures.csv", "tables/key-figures.tex"};
  for (const Figure& figure : contents.figures) {
    for (const FigureFile& file : figure.files) names.push_back("figures/" + file.name);
  }
  Html items;
  for (const std::string& name : names) items += element("li", element("a", {{"href", name}}, text(name)));
  return element("p", text("Files in this page's folder:")) + element("ul", {{"class", "files"}}, items);
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
       element("div", {{"class", "provenance"}}, provenance_tables(run.results))},
      {"files", "Files", files_list(c)}};
  std::erase_if(sections, [](const Section& section) { return section.content.empty(); });
  return sections;
}

Html navigation(const std::vector<Section>& sections) {
  Html items;
  for (const Section& section : sections)
    items += element("li", element("a", {{"href", "#" + section.id}}, text(section.title)));
  return element("nav", {{"aria-label", "Sections"}}, element("ul", items));
}

Html notice(const std::vector<std::string>& missing) {
  if (missing.empty()) return {};
  Html items;
  for (const std::string& line : missing) items += element("li", text(line));
  return element("div", {{"class", "notice"}}, text("Not shown because data are missing:") + element("ul", items));
}

std::string second_flight_note(const nlohmann::json& results) {
  const std::string kind = text_at(results, "/real/kind").value_or("");
  if (kind != "surrogate") return "";
  return " The second flight is a surrogate: not the video of a real flight but rendered, with a camera degraded on "
         "purpose.";
}

Html floor_note(const std::string& remark) {
  return remark.empty() ? Html() : element("p", {{"class", "note"}}, text(remark));
}

Html header(const RunFolder& run, const ReportContents& contents, const std::vector<Section>& sections) {
  const bool has_place = run.results.contains("truth") && !run.results["truth"].is_null();
  const std::string subtitle =
      has_place
          ? "A simulated and a second flight over the same place, mapped by visual odometry and scored against "
            "ground truth from 3D Tiles." +
                second_flight_note(run.results)
          : "A flight without its place, mapped by visual odometry; its path is compared with recorded positions.";
  return element("header", element("h1", text(contents.name)) + element("p", {{"class", "subtitle"}}, text(subtitle)) +
                               element("p", {{"class", "verdict"}}, text(contents.verdict)) +
                               warnings_panel(run.results) + navigation(sections));
}

Html main_part(const ReportContents& contents, const std::vector<Section>& sections) {
  Html parts = element("section", {{"class", "first-screen"}, {"aria-label", "Key figures"}},
                       element("div", key_figures_table(contents.key_figures) + floor_note(contents.remark_on_floor)) +
                           to_html(contents.figure("maps")));
  for (const Section& section : sections) {
    parts += element("section", {{"id", section.id}, {"aria-labelledby", section.id + "-title"}},
                     element("h2", {{"id", section.id + "-title"}}, text(section.title)) + section.content);
  }
  return element("main", {{"id", "main"}}, parts + notice(contents.missing));
}

Html body(const RunFolder& run, const ReportContents& contents, const ReportOptions& options) {
  const std::vector<Section> sections = sections_of(run, contents, options);
  const Html skip = element("a", {{"class", "skip"}, {"href", "#main"}}, text("Skip to the results"));
  const Html footer = element(
      "footer", text("Made by tileflight. Published figures: Beam et al., Cesium Tiles for High-realism Simulation and "
                     "Comparing SLAM Results in Corresponding Virtual and Real-world Environments."));
  return element("body",
                 skip + header(run, contents, sections) + main_part(contents, sections) + footer + view_script());
}

}  // namespace

void write_report(const std::filesystem::path& run_folder, const ReportOptions& options) {
  const RunFolder run = read_run_folder(run_folder);
  const ReportContents contents = build_contents(run);
  const Html page = element("html", {{"lang", "en"}}, page_head(contents.name) + body(run, contents, options));
  const nlohmann::json numbers = report_json(contents, run.results);
  base::write_file(run_folder / "report.html", "<!DOCTYPE html>\n" + page.str() + "\n");
  base::write_file(run_folder / "report.json",
                   numbers.dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
  drawing::write_figures(run_folder / "figures", contents.figures);
  write_key_figures(run_folder / "tables", contents.key_figures);
}

}  // namespace tileflight::report
