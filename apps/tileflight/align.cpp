#include <sstream>

#include "command.h"
#include "map_options.h"

namespace tileflight::app {

void add_align(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    MapOptions map;
    std::string target;
    std::string out;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("align", "registration of a map to ground truth");
  command->footer(
      "Example:\n  tileflight align out/odometry --to out/truth --dataset out/dataset --out transform.json");
  add_map_options(*command, options->map);
  command->add_option("--to", options->target, "folder that `extract` wrote, or a cloud")->required();
  command->add_option("--out", options->out, "transform.json to write")->required();
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress& progress) -> Output {
      const nlohmann::json t = experiment::align(map_inputs(options->map), options->target, {}, options->out, progress);
      std::ostringstream text;
      text << options->out << ": " << t["method"].get<std::string>() << ", scale " << t["scale"] << ", RMSE "
           << t["rmse"] << " m over " << t["fitness"] << " of the points, " << t["iterations"] << " iterations"
           << (t["converged"].get<bool>() ? "" : ", NOT CONVERGED") << "\n";
      return {t, text.str()};
    };
  });
}

}  // namespace tileflight::app
