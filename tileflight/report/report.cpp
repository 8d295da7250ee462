#include "tileflight/report/report.h"

#include <nlohmann/json.hpp>

#include "tileflight/base/files.h"
#include "tileflight/report/doubts_panel.h"
#include "tileflight/report/html.h"
#include "tileflight/report/key_figures_files.h"
#include "tileflight/report/number_format.h"
#include "tileflight/report/report_contents.h"
#include "tileflight/report/run_folder.h"
#include "tileflight/report/view_section.h"

namespace tileflight::report {
namespace {

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
  const std::string subtitle =
      "A simulated and a second flight over the same place, mapped by visual odometry and scored against ground truth "
      "from 3D Tiles." +
      second_flight_note(run.results);
  return element("header", element("h1", text(contents.name)) + element("p", {{"class", "subtitle"}}, text(subtitle)) +
                               element("p", {{"class", "verdict"}}, text(contents.verdict)) +
                               doubts_panel(run.results) + navigation(sections));
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
  write_figures(run_folder / "figures", contents.figures);
  write_key_figures(run_folder / "tables", contents.key_figures);
}

}  // namespace tileflight::report
