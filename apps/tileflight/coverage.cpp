#include "tileflight/capture/preview/coverage.h"

#include <nlohmann/json.hpp>

#include "command.h"
#include "input_options.h"
#include "tileflight/core/base/formatted_text.h"

namespace tileflight::app {
namespace {

std::string percent(double share) { return base::rounded_text(100.0 * share, 2) + " %"; }

std::string table(const nlohmann::json& result, const std::string& out) {
  std::string text = base::formatted("%-12s %6s %8s %10s %10s %9s %9s %9s %9s %9s\n", "strategy", "tiles", "at once",
                                     "MB read", "MB memory", "correct", "coarser", "missing", "worst", "cells");
  for (const char* name : {"view-follow", "view-high", "sensor", "flight", "region"}) {
    const nlohmann::json& s = result["strategies"][name];
    text += base::formatted("%-12s %6d %8d %10.1f %10.1f %9s %9s %9s %9s %9s\n", name, s["tiles"].get<int>(),
                            s["tiles_at_once"].get<int>(), 1e-6 * s["bytes"].get<double>(),
                            1e-6 * s["memory_bytes"].get<double>(), percent(s["right"]).c_str(),
                            percent(s["coarser"]).c_str(), percent(s["missing"]).c_str(),
                            percent(s["missing_worst"]).c_str(), percent(s["cells_share"]).c_str());
  }
  text += out + ": " + std::to_string(result["frames_looked_at"].get<int>()) + " of " +
          std::to_string(result["frames"].get<int>()) + " frames checked; figure.png shows frame " +
          std::to_string(result["picture_frame"].get<int>()) + "\n";
  for (const auto& warning : result["warnings"]) text += "warning: " + warning.get<std::string>() + "\n";
  return text;
}

}  // namespace

void add_coverage(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    RegionOptions region;
    SourceArguments source_arguments;
    preview::CoverageSettings settings;
    std::string flight, out;
    double memory_gb = 0.0;
  };
  auto options = std::make_shared<Options>();
  preview::CoverageSettings& settings = options->settings;
  CLI::App* command = app.add_subcommand(
      "coverage", "compare tile-loading strategies over a flight: holes, tiles and bytes of each frame");
  command->footer(
      "Example:\n  tileflight coverage tiles/tileset.json --flight examples/machangara-flight-simulated.yaml --out "
      "coverage");
  command->add_option("SOURCE", settings.source, kSourceHelp)->required();
  command
      ->add_option(
          "--flight", options->flight,
          "flight file (YAML): camera, trajectory or waypoints, fps; or a mission (QGroundControl, DJI, Litchi, KML)")
      ->required();
  command->add_option("--out", options->out, "folder to write")->required();
  command->add_option("--pixel-error", settings.error_px, "screen-space error that still counts as correct, pixels")
      ->capture_default_str();
  command->add_option("--frames", settings.frames, "number of frames to check, evenly spaced over the flight")
      ->capture_default_str();
  command->add_option("--width", settings.width, "width of the images whose pixels are counted, pixels")
      ->capture_default_str();
  command->add_option("--voxel", settings.voxel_m, "edge of the region's voxels, metres")->capture_default_str();
  command->add_option("--memory", options->memory_gb, "memory limit for tiles, GB (default: half of the machine's)")
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--follow-height", settings.follow_height_m,
                   "height of the view-follow camera above the drone, metres")
      ->capture_default_str();
  command
      ->add_option("--viewer-fov", settings.viewer_fov_deg, "horizontal field of view of the viewers' cameras, degrees")
      ->capture_default_str();
  command->add_option("--viewer-error", settings.viewer_max_error_px, "screen-space error of the viewers, pixels")
      ->capture_default_str();
  add_region_options(*command, options->region);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      options->settings.load = load_options(options->region);
      options->settings.load.source = source_options(options->source_arguments);
      options->settings.flight = options->flight;
      if (options->memory_gb > 0.0)
        options->settings.max_memory_bytes = static_cast<std::uintmax_t>(options->memory_gb * 1e9);
      const nlohmann::json result = preview::measure_coverage(options->settings, options->out, shared.force, progress);
      return {result, table(result, options->out)};
    };
  });
}

}  // namespace tileflight::app
