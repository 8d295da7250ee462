#include "tileflight/experiments/study/study_page.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/drawing/chart.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/core/drawing/page_image.h"
#include "tileflight/core/drawing/top_view.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/experiments/report/warnings_panel.h"
#include "tileflight/experiments/study/study_tables.h"

namespace tileflight::study {

namespace {

using drawing::element;
using drawing::empty_element;
using drawing::Html;
using drawing::svg_number;
using drawing::text;

// Units of the SVG's view box.
constexpr double kWidth = 560, kHeight = 330;
constexpr double kLeft = 74, kRight = 16, kTop = 14, kBottom = 46;
constexpr int kTicks = 6;
constexpr std::array kColors{"#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#a08f00", "#777777"};

/// An axis from data to the view box.
class Axis {
 public:
  Axis(bool logarithmic, double low_px, double high_px)
      : logarithmic_(logarithmic), low_px_(low_px), high_px_(high_px) {}

  bool can_show(double value) const { return std::isfinite(value) && (!logarithmic_ || value > 0.0); }
  void include(double value) {
    low_ = std::min(low_, scaled(value));
    high_ = std::max(high_, scaled(value));
  }
  /// Linear axes begin at zero; some room is left at the ends.
  void settle() {
    if (!logarithmic_) low_ = std::min(0.0, low_);
    if (!(high_ > low_)) high_ = low_ + 1.0;
    const double margin = 0.05 * (high_ - low_);
    high_ += margin;
    if (logarithmic_) low_ -= margin;
  }
  double to_px(double value) const { return low_px_ + (scaled(value) - low_) / (high_ - low_) * (high_px_ - low_px_); }
  std::vector<double> ticks() const {
    if (!logarithmic_) return linear_ticks(low_, high_);
    constexpr std::size_t kFewest = 3;
    const std::vector<double> values = logarithmic_ticks();
    return values.size() < kFewest ? linear_ticks(std::pow(10.0, low_), std::pow(10.0, high_)) : values;
  }

 private:
  static std::vector<double> linear_ticks(double low, double high) {
    std::vector<double> values;
    for (const double tick : drawing::nice_ticks(low, high, kTicks)) values.push_back(tick + 0.0);  // no "-0"
    return values;
  }
  /// 1, 2, 5, 10, …
  std::vector<double> logarithmic_ticks() const {
    std::vector<double> values;
    for (int power = static_cast<int>(std::floor(low_)); power <= static_cast<int>(std::ceil(high_)); ++power) {
      for (const double digit : {1.0, 2.0, 5.0}) {
        const double value = digit * std::pow(10.0, power);
        if (std::log10(value) >= low_ && std::log10(value) <= high_) values.push_back(value);
      }
    }
    return values;
  }
  double scaled(double value) const { return logarithmic_ ? std::log10(value) : value; }

  bool logarithmic_;
  double low_px_, high_px_;
  double low_ = std::numeric_limits<double>::infinity(), high_ = -std::numeric_limits<double>::infinity();
};

Html draw_axes(const Axis& across, const Axis& up, const Scatter& scatter) {
  Html result;
  for (const double tick : across.ticks()) {
    const double x = across.to_px(tick);
    result += drawing::svg_line(x, kHeight - kBottom, x, kHeight - kBottom + 5, "axis") +
              drawing::svg_label(x, kHeight - kBottom + 19, "middle", drawing::format_shortest(tick));
  }
  for (const double tick : up.ticks()) {
    const double y = up.to_px(tick);
    result += drawing::svg_line(kLeft, y, kWidth - kRight, y, "grid") +
              drawing::svg_label(kLeft - 7, y + 4, "end", drawing::format_shortest(tick));
  }
  result += drawing::svg_line(kLeft, kHeight - kBottom, kWidth - kRight, kHeight - kBottom, "axis");
  result += drawing::svg_label((kLeft + kWidth - kRight) / 2, kHeight - 8, "middle", scatter.x_label);
  const double middle = (kTop + kHeight - kBottom) / 2;
  return result + element("text",
                          {{"x", "14"},
                           {"y", svg_number(middle)},
                           {"text-anchor", "middle"},
                           {"transform", "rotate(-90 14 " + svg_number(middle) + ")"}},
                          text(scatter.y_label));
}

}  // namespace

drawing::Drawing to_drawing(const Scatter& scatter) {
  Axis across(scatter.x_is_logarithmic, kLeft, kWidth - kRight), up(scatter.y_is_logarithmic, kHeight - kBottom, kTop);
  std::vector<ScatterPoint> shown;
  for (const ScatterPoint& point : scatter.points) {
    if (!across.can_show(point.x) || !up.can_show(point.y)) continue;
    across.include(point.x);
    up.include(point.y);
    shown.push_back(point);
  }
  drawing::Drawing drawing{.width = kWidth, .height = kHeight, .style = "chart", .label = scatter.title, .content = {}};
  if (shown.empty()) return drawing;
  across.settle();
  up.settle();
  drawing.content = draw_axes(across, up, scatter);
  for (const ScatterPoint& point : shown) {
    drawing.content += element("circle",
                               {{"class", "point series-" + std::to_string(point.series % kColors.size())},
                                {"cx", svg_number(across.to_px(point.x))},
                                {"cy", svg_number(up.to_px(point.y))},
                                {"r", "5"}},
                               element("title", text(point.label)));
  }
  for (std::size_t i = 0; i < scatter.series.size(); ++i)
    drawing.legend.push_back({scatter.series[i], "line series-" + std::to_string(i % kColors.size())});
  return drawing;
}

std::string series_style() {
  std::string style = ".point { stroke: var(--paper); stroke-width: 1; opacity: .85; }\n";
  for (std::size_t i = 0; i < kColors.size(); ++i) {
    const std::string name = "series-" + std::to_string(i);
    style += ".point." + name + " { fill: " + kColors[i] + "; } .line." + name + " { stroke: " + kColors[i] +
             "; stroke-width: 8; }\n";
  }
  return style + ".line.curve { stroke-width: 2; }\n";
}

namespace fs = std::filesystem;
namespace {

using drawing::element;
using drawing::empty_element;
using drawing::format_fixed;
using drawing::Html;
using drawing::number_at;
using drawing::text;
using nlohmann::json;

/// Runs whose pictures are shown.
constexpr std::size_t kWorstRuns = 4;
/// Upper end of the colours of map errors, metres.
constexpr double kLargestError_m = 1.0;

Html paragraph(const std::string& content) { return element("p", text(content)); }

Html section(const std::string& id, const std::string& title, const Html& content) {
  if (content.empty()) return {};
  return element("section", {{"id", id}, {"aria-labelledby", id + "-title"}},
                 element("h2", {{"id", id + "-title"}}, text(title)) + content);
}

/// The matrix with its cells tinted by their score: green is 1, red 0.
Html tinted_matrix(const json& study) {
  const report::Table table = matrix_table(study);
  if (table.rows.empty()) return {};
  Html head, body;
  for (const std::string& name : table.header) head += element("th", {{"scope", "col"}}, text(name));
  for (const auto& row : table.rows) {
    Html cells = element("th", {{"scope", "row"}}, text(row.front()));
    for (std::size_t i = 1; i < row.size(); ++i) {
      char* end = nullptr;
      const double score = std::strtod(row[i].c_str(), &end);
      const bool is_number = end != row[i].c_str();
      const std::string hue = std::to_string(static_cast<int>(std::lround(120.0 * std::clamp(score, 0.0, 1.0))));
      cells += is_number ? element("td", {{"style", "background: hsl(" + hue + " 70% 50% / .35)"}}, text(row[i]))
                         : element("td", text(row[i]));
    }
    body += element("tr", cells);
  }
  const Html whole = element("table", element("caption", text(table.caption)) + element("thead", element("tr", head)) +
                                          element("tbody", body));
  return element("section", {{"class", "table-frame wide"}, {"tabindex", "0"}, {"aria-label", table.caption}}, whole);
}

Html wide_table(const report::Table& table) { return element("div", {{"class", "wide"}}, report::to_html(table)); }

std::vector<std::string> system_titles(const json& study) {
  std::vector<std::string> titles;
  for (const auto& [name, system] : study.at("systems").items()) titles.push_back(system.at("title"));
  return titles;
}

std::size_t series_of(const json& study, const std::string& name) {
  std::size_t index = 0;
  for (const auto& [other, system] : study.at("systems").items()) {
    if (other == name) return index;
    ++index;
  }
  return index;
}

Html scatter_figure(const json& study, Scatter scatter, const char* x, const char* y, const std::string& caption) {
  scatter.series = system_titles(study);
  for (const json& run : study.at("runs")) {
    const auto across = number_at(run, "/" + std::string(x)), up = number_at(run, "/" + std::string(y));
    if (run.at("completed") != true || !across || !up) continue;
    scatter.points.push_back({*across, *up, series_of(study, run.at("system")), run.at("folder")});
  }
  const drawing::Drawing drawing = to_drawing(scatter);
  if (drawing.content.empty()) return {};
  return element("figure", drawing::on_page(drawing) + element("figcaption", text(caption)));
}

Html charts(const json& study) {
  const Html figures =
      scatter_figure(
          study,
          {.title = "Accuracy against completeness",
           .x_label = "completeness",
           .y_label = "accuracy",
           .series = {},
           .points = {}},
          "completeness", "accuracy",
          "Accuracy (share of the map near the surface) against completeness (share of the surface near the map)") +
      scatter_figure(study,
                     {.title = "Error against time",
                      .x_label = "wall-clock time, s",
                      .y_label = "median to surface, m",
                      .x_is_logarithmic = true,
                      .y_is_logarithmic = true,
                      .series = {},
                      .points = {}},
                     "seconds", "surface_median",
                     "Median distance of the map to the surface against the time of the run") +
      scatter_figure(study,
                     {.title = "Error against memory",
                      .x_label = "peak memory, MB",
                      .y_label = "median to surface, m",
                      .x_is_logarithmic = true,
                      .y_is_logarithmic = true,
                      .series = {},
                      .points = {}},
                     "peak_memory_mb", "surface_median",
                     "Median distance of the map to the surface against the memory of the run") +
      scatter_figure(study,
                     {.title = "Path error against time",
                      .x_label = "wall-clock time, s",
                      .y_label = "path error (ATE), m",
                      .x_is_logarithmic = true,
                      .y_is_logarithmic = true,
                      .series = {},
                      .points = {}},
                     "seconds", "ate_rmse", "Path error against the time of the run");
  return figures.empty() ? Html() : element("div", {{"class", "columns"}}, figures);
}

std::string title_of(const json& study, const json& system) {
  return study.at("systems").at(system.get<std::string>()).at("title");
}

std::string range_text(const json& interval) {
  return format_fixed(number_at(interval, "/0"), 2) + " to " + format_fixed(number_at(interval, "/1"), 2);
}

/// States a difference that is more than chance.
std::string real_difference_text(const json& study, const json& one) {
  std::string result = title_of(study, one.at("better")) + " scores " + format_fixed(number_at(one, "/difference"), 2) +
                       " more than " + title_of(study, one.at("worse")) + " (";
  if (one.at("interval").at(0).is_number()) result += range_text(one.at("interval")) + "; ";
  return result + std::to_string(one.at("places").get<int>()) + " places, p " +
         format_fixed(number_at(one, "/adjusted_p"), 3) + " after correction for all pairs).";
}

/// States that a difference may be chance, and what would decide it.
std::string open_difference_text(const json& study, const json& one) {
  std::string result = title_of(study, one.at("better")) + " before " + title_of(study, one.at("worse")) + " by " +
                       format_fixed(number_at(one, "/difference"), 2);
  if (const auto needed = number_at(one, "/places_needed"))
    result += "; about " + format_fixed(needed, 0) + " such places would show a difference of that size";
  return result + ".";
}

Html differences_section(const json& study) {
  const json& differences = study.at("differences");
  if (differences.empty()) return {};
  Html real, open;
  for (const json& one : differences) {
    if (one.at("real") == true)
      real += element("li", text(real_difference_text(study, one)));
    else
      open += element("li", text(open_difference_text(study, one)));
  }
  Html content;
  if (!real.empty()) content += paragraph("These differences are more than chance:") + element("ul", real);
  if (!open.empty()) content += paragraph("These may be chance:") + element("ul", open);
  return content + wide_table(differences_table(study));
}

Html survival_section(const json& study) {
  const json& survival = study.at("survival");
  if (survival.empty()) return {};
  drawing::Chart chart{"Share of the runs without failure against the distance flown",
                       "",
                       {"distance flown, m", 0, 1},
                       {"share of the runs", 0, 1},
                       {},
                       {}};
  for (const auto& [name, survived] : survival.items())
    chart.x.high = std::max(chart.x.high, survived.at("furthest").get<double>());
  for (const auto& [name, survived] : survival.items()) {
    drawing::ChartLine line{.name = title_of(study, name),
                            .style = "series-" + std::to_string(series_of(study, name) % kColors.size()) + " curve",
                            .points = {{0.0, 1.0}}};
    double share = 1.0;
    for (const json& step : survived.at("curve")) {
      const double distance_m = step.at("distance");
      line.points.emplace_back(distance_m, share);
      share = step.at("share");
      line.points.emplace_back(distance_m, share);
    }
    line.points.emplace_back(survived.at("furthest").get<double>(), share);
    chart.lines.push_back(std::move(line));
  }
  const Html figure =
      element("figure", drawing::on_page(drawing::to_drawing(chart)) +
                            element("figcaption", text(chart.title + ": the estimate of Kaplan and Meier")));
  return element("div", {{"class", "columns"}}, figure) +
         paragraph(
             "A run fails where its path has no pose for a second, also at the flight's end, or where a tenth of the "
             "flight does not fit the true path or changes its scale by more than a third. A run that made nothing "
             "fails at 0 m.") +
         wide_table(survival_table(study));
}

std::string agreement_text(const json& tau) {
  std::string result = "Kendall's τ between the orders of " + std::to_string(tau.at("systems").get<int>()) +
                       " systems: " + format_fixed(number_at(tau, "/value"), 2);
  if (tau.at("interval_over_places").at(0).is_number())
    result += ", for these systems over other places " + range_text(tau.at("interval_over_places"));
  if (tau.at("interval").at(0).is_number())
    result += ", for other systems " + range_text(tau.at("interval")) + " (95 %)";
  else
    result += "; fewer than five systems, so that nothing is said of others";
  return result + ".";
}

Html agreement_section(const json& study) {
  const json& tau = study.at("kendall_tau");
  if (tau.is_null()) return {};
  report::Table table{.caption = "Ranks in simulation and on the second flights",
                      .header = {"System", "Rank in simulation", "Rank on second flights", "Changed"},
                      .rows = {}};
  for (const auto& [name, ranks] : tau.at("ranks").items()) {
    const int simulated = ranks.at("simulated"), real = ranks.at("real");
    table.rows.push_back({study.at("systems").at(name).at("title"), std::to_string(simulated), std::to_string(real),
                          simulated == real ? "no" : "yes"});
  }
  Html by_kind;
  for (const auto& [kind, of_kind] : study.at("kendall_tau_by_kind").items())
    by_kind += element("li", text(kind + ": " + agreement_text(of_kind)));
  if (!by_kind.empty()) by_kind = paragraph("By kind of flight:") + element("ul", by_kind);
  return paragraph(agreement_text(tau) +
                   " 1: simulation orders the systems as the second flights do; −1: the other way round.") +
         report::to_html(table) + by_kind;
}

/// The map from above, coloured by its distance to the surface; empty if there is none.
Html error_picture(const fs::path& run) {
  if (!fs::exists(run / "errors.ply")) return {};
  const geometry::PointCloud map = geometry::read_cloud(run / "errors.ply");
  const auto distances = map.scalars.find("surface_distance");
  if (distances == map.scalars.end() || map.positions.empty()) return {};
  const drawing::GroundExtent extent = drawing::limit_aspect_ratio(drawing::fit_extent(map.positions, 0.03, 0.01));
  const std::string png =
      drawing::encode_png(drawing::draw_values(extent, map.positions, distances->second, kLargestError_m));
  return empty_element("img",
                       {{"src", drawing::data_uri("image/png", png)},
                        {"alt", "Map from above, coloured by its distance to the surface, green 0 m to red 1 m"}});
}

/// A picture of the middle of the flight.
Html frame_picture(const fs::path& folder) {
  std::vector<dataset::Frame> frames;
  try {
    frames = dataset::read_dataset(folder).frames;
  } catch (const InputError&) {
    return {};  // not made yet, or no longer there
  }
  if (frames.empty()) return {};
  const fs::path& file = frames[frames.size() / 2].image;
  const std::string type = file.extension() == ".png" ? "image/png" : "image/jpeg";
  return empty_element("img", {{"src", drawing::data_uri(type, base::read_raw(file))}, {"alt", "Image of the flight"}});
}

/// Runs with a score, worst first, at most one of each system and flight.
std::vector<json> worst_runs(const json& study) {
  std::vector<json> runs;
  for (const json& run : study.at("runs")) {
    if (run.at("score").is_number() && run.at("repetition") == 1) runs.push_back(run);
  }
  std::ranges::stable_sort(runs, {}, [](const json& run) { return run.at("score").get<double>(); });
  if (runs.size() > kWorstRuns) runs.resize(kWorstRuns);
  return runs;
}

Html link(const std::string& target) { return element("a", {{"href", target}}, text(target)); }

Html worst_section(const json& study, const fs::path& folder) {
  Html cards;
  for (const json& run : worst_runs(study)) {
    const std::string at = run.at("folder"), dataset = run.at("dataset");
    const fs::path data = fs::path(dataset).is_absolute() ? fs::path(dataset) : folder / dataset;
    std::string about = "score " + format_fixed(number_at(run, "/score"), 3);
    if (const std::string reason = run.at("reason"); !reason.empty()) about += ": " + reason;
    std::string task = at.substr(std::string("runs").size());
    std::ranges::replace(task, '/', '.');
    Html card = element("h3", text(at)) + paragraph(about) + frame_picture(data) + error_picture(folder / at);
    card += element("p", text("Again: ") +
                             element("code", text("sh tasks/system" + task + ".sh && sh tasks/score" + task + ".sh")));
    Html links = link(at + "/odometry/odometry.json");
    for (const char* file : {"/odometry/system.log", "/metrics.json", "/transform.json", "/errors.ply"}) {
      if (fs::exists(folder / (at + file))) links += text(", ") + link(at + file);
    }
    cards += element("div", {{"class", "card"}}, card + element("p", links));
  }
  return cards.empty() ? Html() : element("div", {{"class", "columns"}}, cards);
}

/// Returns a sentence about the time that all runs together took.
std::string cost_text(const json& study) {
  double seconds = 0.0, cpu_seconds = 0.0, memory_mb = 0.0;
  for (const json& run : study.at("runs")) {
    seconds += number_at(run, "/seconds").value_or(0.0);
    cpu_seconds += number_at(run, "/cpu_seconds").value_or(0.0);
    memory_mb = std::max(memory_mb, number_at(run, "/peak_memory_mb").value_or(0.0));
  }
  return "The systems' runs took " + format_fixed(seconds / 60.0, 1) + " minutes, " +
         format_fixed(cpu_seconds / 60.0, 1) + " minutes of processor time, and at most " + format_fixed(memory_mb, 0) +
         " MB. Times of runs that shared the machine with others are not comparable; processor times are, nearly.";
}

/// Rectified pictures and the like.
Html notes_section(const json& study) {
  std::vector<std::string> lines;
  for (const json& run : study.at("runs")) {
    if (run.at("repetition") != 1 || !run.contains("notes") || !run.at("notes").is_array()) continue;
    for (const json& note : run.at("notes")) {
      std::string line = run.at("folder").get<std::string>() + ": " + note.get<std::string>();
      if (const auto share = number_at(run, "/visible_share"); share && *share < 0.999)
        line += " (" + drawing::format_percent(*share) + " of the native image)";
      lines.push_back(line);
    }
  }
  Html items;
  for (const std::string& line : lines) items += element("li", text(line));
  return items.empty() ? Html() : element("ul", items);
}

Html head(const json& study) {
  const std::string style =
      drawing::style_sheet() + series_style() +
      ".wide, .wide .table-frame { max-width: none; } .card { background: var(--panel); padding: .6rem 1rem; }\n"
      ".card img { display: block; max-width: 100%; max-height: 24rem; margin: .4rem 0; background: var(--paper); }\n"
      ".card h3 { margin: .2rem 0; font-size: 1rem; overflow-wrap: anywhere; } .card code { overflow-wrap: anywhere; "
      "}\n";
  return element(
      "head", empty_element("meta", {{"charset", "utf-8"}}) +
                  empty_element("meta", {{"name", "viewport"}, {"content", "width=device-width, initial-scale=1"}}) +
                  empty_element("meta", {{"http-equiv", "Content-Security-Policy"},
                                         {"content", "default-src 'none'; img-src data:; style-src 'unsafe-inline'"}}) +
                  element("title", text(study.at("name").get<std::string>() + " – tileflight")) +
                  element("style", Html::trusted(style)));
}

std::string counted(std::size_t count, const std::string& what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

/// The result in a sentence.
std::string verdict_text(const json& study) {
  const json& ranking = study.at("ranking");
  if (ranking.empty() || ranking.at(0).at("score").is_null()) return "No system has a score.";
  const auto title = [&](const json& ranked) { return title_of(study, ranked.at("system")); };
  std::string result =
      title(ranking.at(0)) + " has the highest score, " + format_fixed(number_at(ranking.at(0), "/score"), 3);
  if (ranking.size() < 2 || ranking.at(1).at("score").is_null()) return result + "; no other system has one.";
  result += ", before " + title(ranking.at(1)) + " with " + format_fixed(number_at(ranking.at(1), "/score"), 3);
  for (const json& one : study.at("differences")) {
    const bool is_this =
        (one.at("better") == ranking.at(0).at("system") && one.at("worse") == ranking.at(1).at("system")) ||
        (one.at("worse") == ranking.at(0).at("system") && one.at("better") == ranking.at(1).at("system"));
    if (is_this && one.at("real") == true) return result + ". " + real_difference_text(study, one);
  }
  return result + "; that difference may be chance.";
}

}  // namespace

std::string study_page(const json& study, const fs::path& folder) {
  const int runs = study.at("repetitions").get<int>();
  const std::string repetitions = runs == 1 ? "one repetition" : std::to_string(runs) + " repetitions";
  const Html header = element(
      "header", element("h1", text(study.at("name").get<std::string>())) +
                    element("p", {{"class", "subtitle"}},
                            text(counted(study.at("systems").size(), "system") + " on " +
                                 counted(study.at("flights").size(), "flight") + ", " + repetitions +
                                 " each, all maps registered by the same rule.")) +
                    element("p", {{"class", "verdict"}}, text(verdict_text(study))) + report::warnings_panel(study));
  const Html files = element(
      "p", text("Beside this page: ") + link("study.json") + text(", ") + link("tables/ranking.csv") + text(", ") +
               link("tables/ranking.tex") + text(", ") + link("tables/differences.csv") + text(", ") +
               link("tables/survival.csv") + text(", ") + link("tables/runs.csv") + text(", ") + link("Snakefile"));
  const Html main = section("ranking", "Ranking", wide_table(ranking_table(study)) + paragraph(cost_text(study))) +
                    section("differences", "What is more than chance", differences_section(study)) +
                    section("survival", "How far systems come", survival_section(study)) +
                    section("matrix", "Systems and flights", tinted_matrix(study)) +
                    section("agreement", "Simulation against second flights", agreement_section(study)) +
                    section("charts", "Quality against cost", charts(study)) +
                    section("worst", "The worst runs", worst_section(study, folder)) +
                    section("notes", "What systems were given", notes_section(study)) +
                    section("runs", "Every run", wide_table(runs_table(study))) + section("files", "Files", files);
  const Html body = element(
      "body", header + element("main", {{"id", "main"}}, main) + element("footer", text("Made by tileflight study.")));
  return "<!DOCTYPE html>\n" + element("html", {{"lang", "en"}}, head(study) + body).str() + "\n";
}

}  // namespace tileflight::study
