#include "tileflight/experiments/report/report.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/drawing/html.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/key_figures_files.h"
#include "tileflight/experiments/report/report_contents.h"
#include "tileflight/experiments/report/run_folder.h"
#include "tileflight/experiments/report/view_section.h"
#include "tileflight/experiments/report/warnings_panel.h"

namespace tileflight::report {
namespace {

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
