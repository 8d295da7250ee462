#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "command.h"
#include "number_text.h"
#include "tileflight/evaluation/scoring/compare_maps.h"

namespace tileflight::app {
namespace {

using nlohmann::json;

struct CompareOptions {
  std::vector<std::filesystem::path> maps;
  scoring::EvaluationSettings settings;
  scoring::ComparisonFiles files;
  scoring::MapSelection selection;
  std::uint64_t seed = 1;
  bool ranking = false;
  std::string by = "map.mean";
};

/// Parts of a comparison whose numbers are printed: "surface.median", "completeness.within_0.2" …, if known.
constexpr std::array<const char*, 3> kParts{"surface", "completeness", "path"};

std::string interval_text(const json& ci) {
  return ci[0].is_null() ? "no interval" : "95 % interval " + rounded_list(ci);
}

std::string measures_of(const json& pair) {
  std::ostringstream text;
  for (const char* part : kParts) {
    if (!pair[part].is_object()) continue;
    for (const auto& [name, m] : pair[part].items()) {
      if (name == "blocks" || !m.is_object()) continue;
      const bool by_ratio = m["margin_of"] == "ratio";
      text << "  " << part << " " << name << ": " << rounded(m["simulated"]) << " and " << rounded(m["real"]) << ", "
           << (by_ratio ? "ratio " : "difference ") << rounded(m[by_ratio ? "ratio" : "difference"]) << ", "
           << interval_text(m[by_ratio ? "ratio_ci95" : "ci95"]) << " by " << m["unit"].get<std::string>()
           << ", margin " << m["margin"] << ": " << m["verdict"].get<std::string>()
           << (m["decides"].get<bool>() ? "" : " (not used for the verdict)") << "\n";
    }
  }
  for (const json& missing : pair["missing_parts"].is_object() ? pair["missing_parts"]["parts"] : json::array()) {
    text << "  missing in the " << (missing["lacks"] == "simulated" ? "first" : "second") << " map: " << missing["edge"]
         << " m around " << missing["center"] << ", points " << missing["points"]["simulated"] << " and "
         << missing["points"]["real"] << "\n";
  }
  return text.str();
}

std::string line_of(const json& pair) {
  std::ostringstream text;
  text << pair["first"].get<std::string>() << " - " << pair["second"].get<std::string>() << ": "
       << pair["verdict"].get<std::string>();
  const char* separator = " because of ";
  for (const json& name : pair["verdict_because"]) {
    text << separator << name.get<std::string>();
    separator = ", ";
  }
  text << "\n";
  for (const json& warning : pair.value("verdict_withheld_by", json::array()))
    text << "  verdict withheld because of a warning (" << warning["where"].get<std::string>()
         << "): " << warning["message"].get<std::string>() << "\n";
  text << measures_of(pair) << "  published measure (nearest voxel centre): mean difference "
       << rounded(pair["mean_difference"]) << " m, " << interval_text(pair["mean_difference_ci95"]) << " m by "
       << pair["unit"].get<std::string>() << ": " << pair["mean_difference_verdict"].get<std::string>()
       << "\n  Kolmogorov-Smirnov " << rounded(pair["ks_statistic"]) << ", Wasserstein "
       << rounded(pair["wasserstein_m"]) << " m, ratio of points " << rounded(pair["points_ratio"]) << "\n";
  return text.str();
}

Output compare(const CompareOptions& options) {
  const auto [result, table] =
      scoring::compare_maps(options.maps, options.settings, options.seed, options.files, options.selection);
  std::string text = table + "\n";
  for (const json& pair : result["pairs"]) text += line_of(pair);
  return {result, text};
}

Output rank(const CompareOptions& options) {
  const json result = scoring::compare_ranking(options.maps, options.by, options.seed);
  std::ostringstream text;
  for (const json& item : result["list"]) {
    text << item["name"].get<std::string>() << ": simulated " << rounded(item["simulated"]) << ", real "
         << rounded(item["real"]) << "\n";
  }
  text << "Kendall's tau-b " << rounded(result["tau_b"]) << ", 95 % interval " << rounded_list(result["ci95"]) << " ("
       << result["interval"].get<std::string>() << "), p " << rounded(result["p_value"]) << "\n";
  return {result, text.str()};
}

/// Margins within which two maps count as equivalent.
void add_margins(CLI::App& command, scoring::EvaluationSettings& settings) {
  command
      .add_option("--margin", settings.equivalence_margin_m,
                  "equivalence margin of the published measure, metres (default 0.05)")
      ->check(CLI::PositiveNumber);
  const CLI::Validator above_one(
      [](const std::string& text) {
        return CLI::Range(std::nextafter(1.0, 2.0), 1e9)(text).empty() ? "" : "must be above 1";
      },
      "FLOAT > 1");
  command
      .add_option("--ratio-margin", settings.ratio_margin,
                  "equivalence margin of medians and RMS distances to the surface, as a ratio (default 1.25)")
      ->check(above_one);
  command
      .add_option("--share-margin", settings.share_margin,
                  "equivalence margin of shares of map points, as a difference (default 0.05)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--completeness-margin", settings.completeness_margin,
                  "equivalence margin of completeness, as a ratio (default 1.1)")
      ->check(above_one);
  command
      .add_option("--lacking-margin", settings.lacking_margin,
                  "equivalence margin of the share that one map misses of what the other covers, as a difference "
                  "(default 0.01)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--path-margin", settings.path_margin_m, "equivalence margin of path errors, metres (default 0.1)")
      ->check(CLI::PositiveNumber);
}

}  // namespace

void add_compare(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<CompareOptions>();
  CLI::App* command = app.add_subcommand("compare", "compare scored maps side by side, with statistics");
  command->footer(
      "Example:\n  tileflight compare out/stadium/simulated/metrics.json out/stadium/real/metrics.json\n"
      "  tileflight compare out/a out/b out/c --tex table.tex\n"
      "  tileflight compare out/* --against out/a/simulated --rows '*/simulated' --columns mean_m,ate_rmse_m --csv "
      "t.csv\n"
      "  tileflight compare --ranking --by surface.median out/a out/b out/c");
  command
      ->add_option("MAP", options->maps,
                   "metrics.json, or a folder written by `run` (all of its flights, and those of its variants)")
      ->required();
  add_margins(*command, options->settings);
  command->add_option("--csv", options->files.csv,
                      "CSV file to write, one line per map; NAME-pairs.csv beside it has one line per pair");
  command->add_option("--text", options->files.text, "text file to write: the table of maps as it is printed");
  CLI::Option* against =
      command->add_option("--against", options->selection.against,
                          "compare every map with this one only: its name as printed, or its metrics.json or folder");
  command
      ->add_option(
          "--rows", options->selection.rows,
          "maps to compare and show, in this order: names as printed, or patterns such as '*/simulated'; separated "
          "by commas")
      ->delimiter(',')
      ->allow_extra_args(false);
  command
      ->add_option(
          "--columns", options->selection.columns,
          "columns of the tables: mean_m, ate_rmse_m, ... (those of the CSV file), or numbers of metrics.json, "
          "such as surface.accuracy.0.2; separated by commas")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("--tex", options->files.tex, "LaTeX file to write, with both tables (needs booktabs)");
  CLI::Option* ranking = command->add_flag(
      "--ranking", options->ranking,
      "each MAP is the run folder of one setting; compare how simulation and reality rank the settings");
  ranking->excludes(against);
  command->add_option("--by", options->by, "value of metrics.json to rank by (default map.mean)")->needs(ranking);
  command->add_option("--seed", options->seed, "seed of the bootstrap (default 1)");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress&) -> Output {
      return options->ranking ? rank(*options) : compare(*options);
    };
  });
}

}  // namespace tileflight::app
