#include "tileflight/capture/preview/preview.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "input_options.h"
#include "tileflight/capture/preview/preview_json.h"
#include "tileflight/experiments/experiment/experiment_file.h"

namespace tileflight::app {
namespace {

struct PreviewOptions {
  RegionOptions region;
  SourceArguments source_arguments;
  preview::PreviewSettings settings;
  std::string flight, degrade, out;
  std::optional<double> pixel_error, memory_gb;
};

Output preview(PreviewOptions& options, bool force, const Progress& progress) {
  recording::RenderSettings& settings = options.settings.render;
  settings.fly_autopilot = autopilot_flyer();
  settings.load = load_options(options.region);
  settings.load.source = source_options(options.source_arguments);
  const bool has_region = settings.load.center || settings.load.center_local;
  if (options.pixel_error || !has_region) settings.error_px = options.pixel_error.value_or(1.0);
  settings.flight.flight = options.flight;
  if (!options.degrade.empty()) {
    auto degrade = base::StrictSection::load(options.degrade);
    experiment::read_degrade(degrade, settings.flight);
  }
  const nlohmann::json found = preview::preview_flight(options.settings, options.out, force, progress);
  return {found, preview::preview_text(found, options.out)};
}

}  // namespace

void add_preview(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<PreviewOptions>();
  recording::RenderSettings& render = options->settings.render;
  CLI::App* command =
      app.add_subcommand("preview", "preview a flight before rendering: map, profile, three images, cost, warnings");
  command->footer(
      "Example:\n  tileflight preview tiles/tileset.json --flight flight.yaml --out preview\nThen look at "
      "preview/map.png, "
      "preview/profile.png, preview/first.jpg, middle.jpg and last.jpg.");
  command->add_option("SOURCE", render.source, kSourceHelp)->required();
  command
      ->add_option(
          "--flight", options->flight,
          "flight file (YAML): camera, trajectory or waypoints, fps; or a mission (QGroundControl, DJI, Litchi, KML)")
      ->required();
  command->add_option("--out", options->out, "folder to write")->required();
  command
      ->add_option("--samples", render.flight.samples_per_pixel,
                   "samples per pixel of the planned rendering: 1, 4, 9 or 16 (default 1)")
      ->check(CLI::IsMember({1, 4, 9, 16}));
  command
      ->add_option(
          "--degrade", options->degrade,
          "camera degradation of the planned rendering: a YAML file with the keys of an experiment's `degrade`")
      ->check(CLI::ExistingFile);
  command->add_option("--near", options->settings.check.min_clearance_m, "warn about surfaces nearer than this, metres")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--pixel-error", options->pixel_error,
                   "screen-space error of the tiles in the planned rendering, as in `render`, pixels (default 1)")
      ->check(CLI::PositiveNumber);
  command->add_option("--memory", options->memory_gb, "memory limit for tiles, GB (default: half of the machine's)")
      ->check(CLI::PositiveNumber);
  add_region_options(*command, options->region);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    if (options->memory_gb)
      options->settings.render.max_memory_bytes = static_cast<std::uintmax_t>(*options->memory_gb * 1e9);
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return preview(*options, shared.force, progress);
    };
  });
}

}  // namespace tileflight::app
