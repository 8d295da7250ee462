#include <sstream>

#include "command.h"
#include "tileflight/experiment/score.h"

namespace tileflight::app {

void add_compare(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string simulated, real;
    experiment::EvaluationSettings settings;
    std::uint64_t seed = 1;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("compare", "two scored maps side by side, with statistics");
  command->footer("Example:\n  tileflight compare out/stadium/simulated/metrics.json out/stadium/real/metrics.json");
  command->add_option("SIMULATED", options->simulated, "metrics.json of the simulated flight")->required();
  command->add_option("REAL", options->real, "metrics.json of the other flight")->required();
  command
      ->add_option("--margin", options->settings.equivalence_margin_m,
                   "margin of the equivalence test, metres (default 0.05)")
      ->check(CLI::PositiveNumber);
  command->add_option("--seed", options->seed, "seed of the bootstrap (default 1)");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress&) -> Output {
      const nlohmann::json c = experiment::compare(options->simulated, options->real, options->settings, options->seed);
      std::ostringstream text;
      text << "mean difference " << c["mean_difference"] << " m, 95 % interval " << c["mean_difference_ci95"]
           << " m: " << c["verdict"].get<std::string>() << "\nKolmogorov-Smirnov " << c["ks_statistic"]
           << ", Wasserstein " << c["wasserstein_m"] << " m, ratio of points " << c["points_ratio"] << "\n";
      return {c, text.str()};
    };
  });
}

}  // namespace tileflight::app
