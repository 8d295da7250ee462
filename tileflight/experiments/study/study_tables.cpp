#include "tileflight/experiments/study/study_tables.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/drawing/drawing.h"
#include "tileflight/core/drawing/number_format.h"
#include "tileflight/experiments/report/key_figures.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using drawing::format_fixed;
using drawing::number_at;
using nlohmann::json;
using report::Table;

std::optional<double> median_of(const json& runs, const std::string& system, const char* key) {
  std::vector<double> values;
  for (const json& run : runs) {
    if (run.at("system") == system && run.at("completed") == true && run.contains(key) && run.at(key).is_number())
      values.push_back(run.at(key));
  }
  if (values.empty()) return std::nullopt;
  return base::median(values);
}

std::string flight_name(const json& run) {
  const std::string camera = run.at("camera"), flight = run.at("flight");
  return run.at("place").get<std::string>() + (camera.empty() ? "" : ", " + camera) + ", " +
         (flight == "real" ? "second flight" : flight);
}

std::string interval_text(const json& interval) {
  if (!interval.at(0).is_number()) return drawing::kUnknown;
  return format_fixed(interval.at(0).get<double>(), 3) + " to " + format_fixed(interval.at(1).get<double>(), 3);
}

/// A Table's first row is its header.
std::vector<std::vector<std::string>> with_header(const Table& table) {
  std::vector<std::vector<std::string>> lines{table.header};
  lines.insert(lines.end(), table.rows.begin(), table.rows.end());
  for (auto& line : lines) std::ranges::replace(line, std::string(drawing::kUnknown), std::string());
  return lines;
}

std::string latex(const Table& table) {
  const auto line = [](const std::vector<std::string>& cells) {
    std::string text;
    for (const std::string& cell : cells) text += (text.empty() ? "" : " & ") + report::latex_text(cell);
    return text + " \\\\\n";
  };
  std::string text = "% " + table.caption + "\n\\begin{tabular}{l" + std::string(table.header.size() - 1, 'r') +
                     "}\n\\toprule\n" + line(table.header) + "\\midrule\n";
  for (const auto& row : table.rows) text += line(row);
  return text + "\\bottomrule\n\\end{tabular}\n";
}

}  // namespace

Table ranking_table(const json& study) {
  const bool by_path = study.at("rank_by") == "ate";
  const std::string threshold = drawing::format_shortest(study.at("threshold_m").get<double>());
  Table table{.caption = by_path ? "Systems by their paths: score 1 for a perfect path, 0 from an error of " +
                                       drawing::format_shortest(study.at("ate_limit_m").get<double>()) +
                                       " m on, for a frame without a pose, and for a failed run"
                                 : "Systems by their maps: F-score at " + threshold + " m, 0 for a failed run",
              .header = {"System", "Score", "95 % interval", "Over", "Flights", "Failed runs", "Frames tracked",
                         "Median to surface, m", "Path error (ATE), m", "Time, s", "Processor time, s", "Memory, MB"},
              .rows = {}};
  for (const json& ranked : study.at("ranking")) {
    const std::string name = ranked.at("system");
    const json& robustness = study.at("robustness").at(name);
    const double frames = robustness.at("frames"), tracked = robustness.at("frames_tracked");
    const auto median = [&](const char* key, int decimals) {
      return format_fixed(median_of(study.at("runs"), name, key), decimals);
    };
    table.rows.push_back({study.at("systems").at(name).at("title"), format_fixed(number_at(ranked, "/score"), 3),
                          interval_text(ranked.at("interval")),
                          ranked.at("interval_over") == "none" ? drawing::kUnknown : ranked.at("interval_over"),
                          std::to_string(ranked.at("flights").get<int>()),
                          robustness.at("runs") == 0 ? drawing::kUnknown
                                                     : std::to_string(robustness.at("failed").get<int>()) + " of " +
                                                           std::to_string(robustness.at("runs").get<int>()),
                          frames > 0 ? drawing::format_percent(tracked / frames) : drawing::kUnknown,
                          median("surface_median", 3), median("ate_rmse", 3), median("seconds", 1),
                          median("cpu_seconds", 1), median("peak_memory_mb", 0)});
  }
  return table;
}

Table differences_table(const json& study) {
  Table table{.caption = "Differences of the mean scores on common flights; p after Holm's correction for all pairs",
              .header = {"Better", "Than", "Difference", "95 % interval", "p", "p, corrected", "Flights", "Places",
                         "Places that would show it"},
              .rows = {}};
  const auto title = [&](const json& system) { return study.at("systems").at(system.get<std::string>()).at("title"); };
  for (const json& one : study.at("differences")) {
    table.rows.push_back({title(one.at("better")), title(one.at("worse")),
                          format_fixed(number_at(one, "/difference"), 3), interval_text(one.at("interval")),
                          format_fixed(number_at(one, "/p"), 4), format_fixed(number_at(one, "/adjusted_p"), 4),
                          std::to_string(one.at("flights").get<int>()), std::to_string(one.at("places").get<int>()),
                          format_fixed(number_at(one, "/places_needed"), 0)});
  }
  return table;
}

Table survival_table(const json& study) {
  Table table{.caption = "How far systems came before their path ended, had a gap or broke (Kaplan and Meier)",
              .header = {"System", "Runs", "Failed", "Whole after half of the longest flight", "Whole at its end",
                         "95 % interval", "Half have failed after, m"},
              .rows = {}};
  double longest = 0.0;
  for (const auto& [name, survived] : study.at("survival").items())
    longest = std::max(longest, survived.at("furthest").get<double>());
  for (const auto& [name, survived] : study.at("survival").items()) {
    json half{{"share", 1.0}, {"interval", {nullptr, nullptr}}}, end = half;
    std::optional<double> median;
    for (const json& step : survived.at("curve")) {
      if (step.at("distance").get<double>() <= 0.5 * longest) half = step;
      end = step;
      if (!median && step.at("share").get<double>() <= 0.5) median = step.at("distance").get<double>();
    }
    table.rows.push_back({study.at("systems").at(name).at("title"), std::to_string(survived.at("runs").get<int>()),
                          std::to_string(survived.at("failed").get<int>()),
                          drawing::format_percent(half.at("share").get<double>()),
                          drawing::format_percent(end.at("share").get<double>()), interval_text(end.at("interval")),
                          format_fixed(median, 1)});
  }
  return table;
}

Table matrix_table(const json& study) {
  std::vector<std::string> flights;
  std::map<std::pair<std::string, std::string>, std::vector<double>> scores;
  std::map<std::pair<std::string, std::string>, std::string> reasons;
  for (const json& run : study.at("runs")) {
    const std::string flight = flight_name(run), system = run.at("system");
    if (!std::ranges::count(flights, flight)) flights.push_back(flight);
    if (run.at("score").is_number()) scores[{system, flight}].push_back(run.at("score"));
    if (run.at("applicable") == false) reasons[{system, flight}] = "not applicable";
  }
  Table table{
      .caption = "Score of each system on each flight (mean over repetitions)", .header = {"System"}, .rows = {}};
  table.header.insert(table.header.end(), flights.begin(), flights.end());
  for (const json& ranked : study.at("ranking")) {
    const std::string system = ranked.at("system");
    std::vector<std::string> row{study.at("systems").at(system).at("title")};
    for (const std::string& flight : flights) {
      const std::vector<double>& found = scores[{system, flight}];
      double sum = 0.0;
      for (const double score : found) sum += score;
      row.push_back(found.empty() ? reasons.contains({system, flight}) ? reasons[{system, flight}] : drawing::kUnknown
                                  : format_fixed(sum / static_cast<double>(found.size()), 3));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

Table runs_table(const json& study) {
  Table table{.caption = "Every run",
              .header = {"Run", "Score", "Accuracy", "Completeness", "F-score", "Median to surface, m",
                         "of that by the alignment, m", "AWD, m", "SCS", "Path error (ATE), m", "Frames tracked",
                         "Time, s", "Processor time, s", "Memory, MB", "Why not"},
              .rows = {}};
  for (const json& run : study.at("runs")) {
    const auto number = [&](const char* key, int decimals) {
      return format_fixed(number_at(run, "/" + std::string(key)), decimals);
    };
    table.rows.push_back(
        {run.at("folder"), number("score", 3), number("accuracy", 3), number("completeness", 3), number("f_score", 3),
         number("surface_median", 3), number("alignment_metres", 3), number("awd", 3), number("scs", 3),
         number("ate_rmse", 3),
         run.at("frames").is_number() ? number("frames_tracked", 0) + " of " + number("frames", 0) : drawing::kUnknown,
         number("seconds", 1), number("cpu_seconds", 1), number("peak_memory_mb", 0), run.at("reason")});
  }
  return table;
}

void write_study_tables(const json& study, const fs::path& folder) {
  base::make_folder(folder);
  const std::vector<std::pair<std::string, Table>> tables{{"ranking", ranking_table(study)},
                                                          {"differences", differences_table(study)},
                                                          {"survival", survival_table(study)},
                                                          {"matrix", matrix_table(study)},
                                                          {"runs", runs_table(study)}};
  for (const auto& [name, table] : tables) {
    base::write_file(folder / (name + ".csv"), drawing::to_csv(with_header(table)));
    base::write_file(folder / (name + ".tex"), latex(table));
  }
}

}  // namespace tileflight::study
