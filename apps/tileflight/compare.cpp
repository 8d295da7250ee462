#include <sstream>

#include "command.h"
#include "number_text.h"
#include "tileflight/experiment/compare_maps.h"

namespace tileflight::app {
namespace {

using nlohmann::json;

struct Options {
  std::vector<std::filesystem::path> maps;
  experiment::EvaluationSettings settings;
  experiment::CompareFiles files;
  std::uint64_t seed = 1;
  bool ranking = false;
  std::string by = "map.mean";
};

std::string line_of(const json& pair) {
  std::ostringstream text;
  text << pair["first"].get<std::string>() << " - " << pair["second"].get<std::string>() << ": mean difference "
       << rounded(pair["mean_difference"]) << " m, 95 % interval " << rounded_list(pair["mean_difference_ci95"])
       << " m by " << pair["unit"].get<std::string>() << ": " << pair["verdict"].get<std::string>()
       << "\n  Kolmogorov-Smirnov " << rounded(pair["ks_statistic"]) << ", Wasserstein "
       << rounded(pair["wasserstein_m"]) << " m, ratio of points " << rounded(pair["points_ratio"]) << "\n";
  return text.str();
}

Output compare(const Options& options) {
  const json result = experiment::compare_maps(options.maps, options.settings, options.seed, options.files);
  std::ostringstream text;
  for (const json& map : result["maps"]) {
    text << map["name"].get<std::string>() << ": " << map["correspondences"] << " of " << map["points"]
         << " points kept, mean " << rounded(map["mean_m"]) << " m, std " << rounded(map["std_m"])
         << " m, to the surface: median " << rounded(map["surface_median_m"]) << " m\n";
  }
  for (const json& pair : result["pairs"]) text << line_of(pair);
  return {result, text.str()};
}

Output rank(const Options& options) {
  const json result = experiment::compare_ranking(options.maps, options.by, options.seed);
  std::ostringstream text;
  for (const json& item : result["list"]) {
    text << item["name"].get<std::string>() << ": simulated " << rounded(item["simulated"]) << ", real "
         << rounded(item["real"]) << "\n";
  }
  text << "Kendall's tau-b " << rounded(result["tau_b"]) << ", 95 % interval " << rounded_list(result["ci95"]) << " ("
       << result["interval"].get<std::string>() << "), p " << rounded(result["p_value"]) << "\n";
  return {result, text.str()};
}

}  // namespace

void add_compare(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("compare", "scored maps side by side, with statistics");
  command->footer(
      "Example:\n  tileflight compare out/stadium/simulated/metrics.json out/stadium/real/metrics.json\n"
      "  tileflight compare out/a out/b out/c --tex table.tex\n"
      "  tileflight compare --ranking --by surface.median out/a out/b out/c");
  command->add_option("MAP", options->maps, "metrics.json, or a folder that `run` wrote: all of its flights")
      ->required();
  command
      ->add_option("--margin", options->settings.equivalence_margin_m,
                   "margin of the equivalence test, metres (default 0.05)")
      ->check(CLI::PositiveNumber);
  command->add_option("--csv", options->files.csv, "write a line a map here, and a line a pair to NAME-pairs.csv");
  command->add_option("--tex", options->files.tex, "write both tables here, for LaTeX with booktabs");
  CLI::Option* ranking =
      command->add_flag("--ranking", options->ranking,
                        "each MAP is a run folder of another setting: does simulation rank them as reality does?");
  command->add_option("--by", options->by, "number of metrics.json that ranks (default map.mean)")->needs(ranking);
  command->add_option("--seed", options->seed, "seed of the bootstrap (default 1)");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress&) -> Output {
      return options->ranking ? rank(*options) : compare(*options);
    };
  });
}

}  // namespace tileflight::app
