#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "command.h"
#include "input_options.h"
#include "number_text.h"
#include "tileflight/evaluation/scoring/localize_stage.h"
#include "warnings_text.h"

namespace tileflight::app {
namespace {

struct LocalizeOptions {
  std::string dataset;
  std::string source;
  RegionOptions region;
  SourceArguments source_arguments;
  std::string odometry;
  std::string mode = "mono";
  bool search = false;
  int width = 640;
  std::string out;
};

std::string localize_summary(const nlohmann::json& result, const std::string& out) {
  std::ostringstream text;
  text << out << ": " << result["located"] << " of " << result["images"] << " images located in the place, "
       << result["bridged"] << " by the odometry between them; sigma " << rounded(result["sigma_position_m"], 3)
       << " m and " << rounded(result["sigma_rotation_deg"], 3) << " degrees (median), "
       << rounded(result["images_per_second"], 3) << " images per second\n";
  if (!result["receiver"].is_null())
    text << "receiver's positions: " << rounded(result["receiver"]["rms_m"], 3)
         << " m from the path (RMS), stated sigma " << rounded(result["receiver"]["stated_sigma_m"], 3) << " m\n";
  text << warnings_text(result);
  return text.str();
}

}  // namespace

void add_localize(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<LocalizeOptions>();
  CLI::App* command = app.add_subcommand("localize", "the pose of every image of a flight against the tiles");
  command->footer(
      "Example:\n  tileflight localize out/real/dataset --to tiles/tileset.json --out out/localized\n"
      "With a ground truth and an odometry that are there already:\n"
      "  tileflight localize dataset --to out/truth --odometry out/odometry --out out/localized");
  command->add_option("DATASET", options->dataset, "dataset folder of the flight")->required();
  command
      ->add_option("--to", options->source, std::string("the place: a folder that `extract` wrote, or ") + kSourceHelp)
      ->required();
  add_region_options(*command, options->region);
  add_source_options(*command, options->source_arguments);
  command->add_option("--odometry", options->odometry,
                      "folder that `odometry` wrote for these images (default: the built-in odometry tracks them)");
  command
      ->add_option("--mode", options->mode,
                   "sensors of the built-in odometry: mono, inertial, stereo or stereo-inertial")
      ->capture_default_str();
  command->add_flag("--search", options->search,
                    "do not use the dataset's positions: find the flight anywhere in the region by its images");
  command->add_option("--width", options->width, "images are compared with the place at this width at most, pixels")
      ->check(CLI::Range(160, 4096))
      ->capture_default_str();
  command->add_option("--out", options->out, "folder to write")->required();
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      scoring::LocalizeSettings settings{.dataset = options->dataset,
                                         .place = options->source,
                                         .load = load_options(options->region),
                                         .odometry = options->odometry,
                                         .track = {},
                                         .align = {},
                                         .width = options->width};
      settings.load.source = source_options(options->source_arguments);
      settings.track.mode = odometry::parse_odometry_mode("--mode", options->mode);
      if (options->search) settings.align.start = alignment::AlignmentStart::kGeometry;
      const nlohmann::json result = to_json(scoring::localize(settings, options->out, shared.force, progress));
      return {result, localize_summary(result, options->out)};
    };
  });
}

}  // namespace tileflight::app
