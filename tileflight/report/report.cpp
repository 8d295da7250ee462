#include "tileflight/report/report.h"

#include "tileflight/geometry/files.h"
#include "tileflight/report/ablation_table.h"
#include "tileflight/report/figures.h"
#include "tileflight/report/html.h"
#include "tileflight/report/key_figures.h"
#include "tileflight/report/key_figures_files.h"
#include "tileflight/report/numbers.h"
#include "tileflight/report/run_folder.h"
#include "tileflight/report/style_sheet.h"
#include "tileflight/report/tables.h"

namespace tileflight::report {
namespace {

/// A part of the page below the first screen.
struct Section {
  std::string id, title;
  Html content;
};

Html columns(const Html& content) { return element("div", {{"class", "columns"}}, content); }

/// In the order of reading; empty ones are left out.
std::vector<Section> sections_of(const RunFolder& run) {
  const std::vector<Section> all{
      {"errors", "Map error",
       columns(histogram_figure(run) + cumulative_figure(run)) + percentiles_table(run.flights) +
           surface_table(run.flights) + comparison_table(run.results)},
      {"frames", "Pictures of the flights", frames_figure(run)},
      {"error-maps", "Where the error is", error_maps_figure(run)},
      {"paths", "Paths", columns(paths_figure(run) + trajectory_table(run.flights)) + reproduction_table(run.results)},
      {"tracking", "Odometry and alignment", tracking_table(run.flights)},
      {"ablation", "Variants of the simulated flight", ablation_table(run.results)},
      {"provenance", "Where the numbers come from",
       element("div", {{"class", "provenance"}}, provenance_tables(run.results))}};
  std::vector<Section> shown;
  for (const Section& section : all) {
    const bool empty = section.content.empty() || section.content.str() == columns(Html()).str();
    if (!empty) shown.push_back(section);
  }
  return shown;
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
  return element("div", {{"class", "notice"}}, text("Not shown, for want of data:") + element("ul", items));
}

std::string name_of(const nlohmann::json& results) {
  const std::string name = text_at(results, "/name").value_or("");
  return name.empty() ? "Flight experiment" : name;
}

std::string second_flight_note(const nlohmann::json& results) {
  const std::string kind = text_at(results, "/real/kind").value_or("");
  if (kind != "surrogate") return "";
  return " The second flight is a surrogate: no video of a real flight, but rendered, with a camera made worse on "
         "purpose.";
}

Html floor_note(const nlohmann::json& results) {
  const std::string remark = remark_on_floor(results);
  return remark.empty() ? Html() : element("p", {{"class", "note"}}, text(remark));
}

Html head(const std::string& name) {
  return element(
      "head", empty_element("meta", {{"charset", "utf-8"}}) +
                  empty_element("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}}) +
                  // Nothing is loaded from anywhere, and nothing runs, whatever names and files held.
                  empty_element("meta", {{"http-equiv", "Content-Security-Policy"},
                                         {"content", "default-src 'none'; img-src data:; style-src 'unsafe-inline'"}}) +
                  element("title", text(name + " \u2013 tileflight")) +
                  element("style", Html::trusted(std::string(style_sheet()))));
}

Html body(const RunFolder& run) {
  const std::vector<Section> sections = sections_of(run);
  const std::string subtitle =
      "A simulated and a second flight over the same place, mapped by visual odometry and scored against ground truth "
      "from 3D Tiles." +
      second_flight_note(run.results);
  const Html top =
      element("a", {{"class", "skip"}, {"href", "#main"}}, text("Skip to the results")) +
      element("header", element("h1", text(name_of(run.results))) +
                            element("p", {{"class", "subtitle"}}, text(subtitle)) +
                            element("p", {{"class", "verdict"}}, text(verdict(run.results))) + navigation(sections));
  const Html first_screen =
      element("section", {{"class", "first-screen"}, {"aria-label", "Key figures"}},
              element("div", key_figures_table(key_figures(run.results)) + floor_note(run.results)) + maps_figure(run));
  Html rest;
  for (const Section& section : sections) {
    rest += element("section", {{"id", section.id}, {"aria-labelledby", section.id + "-title"}},
                    element("h2", {{"id", section.id + "-title"}}, text(section.title)) + section.content);
  }
  return element(
      "body",
      top + element("main", {{"id", "main"}}, first_screen + rest + notice(run.missing)) +
          element(
              "footer",
              text("Made by tileflight. Published figures: Beam et al., Cesium Tiles for High-realism Simulation and "
                   "Comparing SLAM Results in Corresponding Virtual and Real-world Environments.")));
}

}  // namespace

void write_report(const std::filesystem::path& run_folder) {
  const RunFolder run = read_run_folder(run_folder);
  const Html page = element("html", {{"lang", "en"}}, head(name_of(run.results)) + body(run));
  geometry::write_file(run_folder / "report.html", "<!DOCTYPE html>\n" + page.str() + "\n");
  write_key_figures(run_folder / "tables", key_figures(run.results));
}

}  // namespace tileflight::report
