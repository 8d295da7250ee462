#include <nlohmann/json.hpp>

#include <sstream>

#include "command.h"
#include "map_options.h"
#include "number_text.h"
#include "tileflight/base/output_folder.h"
#include "tileflight/experiment/stage_options.h"

namespace tileflight::app {
namespace {

/// Throws InputError if metrics.json or a file written beside it is an input.
void require_no_input(const std::filesystem::path& metrics_json, const std::vector<std::filesystem::path>& inputs) {
  for (const std::filesystem::path& file :
       {metrics_json, metrics_json.parent_path() / "errors.ply", scoring::seen_surface_file(metrics_json)})
    base::require_not_input(file, inputs);
}

}  // namespace

void add_evaluate(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    MapOptions map;
    std::string truth, transform, out, settings_file;
    scoring::EvaluationSettings settings;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("evaluate", "map and trajectory error of an aligned map");
  command->footer(
      "Example:\n  tileflight evaluate out/odometry --truth out/truth --transform transform.json --out metrics.json");
  add_map_options(*command, options->map);
  command->add_option("--truth", options->truth, "folder written by `extract`")->required();
  command->add_option("--transform", options->transform, "transform.json of `align`")->required();
  command->add_option("--out", options->out, "metrics.json to write; errors.ply is written beside it")->required();
  command
      ->add_option("--cutoff", options->settings.cutoff_m, "maximum distance of a correspondence, metres (default 1)")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--settings", options->settings_file,
                   "experiment or study file whose section `evaluation:` is used instead of options")
      ->check(CLI::ExistingFile)
      ->excludes(command->get_option("--cutoff"));
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress& progress) -> Output {
      if (!options->settings_file.empty())
        options->settings = experiment::read_evaluation_file(options->settings_file);
      std::vector<std::filesystem::path> inputs = files_named(options->map);
      inputs.insert(inputs.end(), {options->truth, options->transform});
      require_no_input(options->out, inputs);
      const nlohmann::json m = scoring::evaluate(map_inputs(options->map), options->truth, options->transform,
                                                 options->settings, options->out, progress);
      std::ostringstream text;
      text << options->out << ": " << m["map"]["correspondences"] << " of " << m["map"]["points"] << " points within "
           << rounded(m["map"]["cutoff"]) << " m of a voxel centre, mean " << rounded(m["map"]["mean"]) << " m, std "
           << rounded(m["map"]["std"]) << " m (floor " << rounded(m["map"]["quantization_floor"]["mean"]) << "); ";
      if (m["surface"].is_null()) {
        text << "the ground truth holds points only, so there are no distances to the surface\n";
      } else {
        text << "to the surface: median " << rounded(m["surface"]["median"]) << " m\n";
      }
      if (!m["trajectory"].is_null())
        text << "ATE RMSE " << rounded(m["trajectory"]["ate_rmse"]) << " m over "
             << rounded(m["trajectory"]["path_length"]) << " m\n";
      return {m, text.str()};
    };
  });
}

}  // namespace tileflight::app
