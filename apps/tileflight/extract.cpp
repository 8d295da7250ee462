#include "tileflight/place/extract.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "number_text.h"
#include "region_options.h"
#include "source_options.h"

namespace tileflight::app {
namespace {

struct ExtractOptions {
  std::string source;
  RegionOptions region;
  SourceArguments source_arguments;
  double voxel_m = 1.0;
  std::string block;
  double memory_gb = 0.0;
  bool dry_run = false;
  std::string out;
};

std::string extract_summary(const nlohmann::json& result, const std::string& out) {
  std::ostringstream text;
  text << out << ": " << result["triangles"] << " triangles from " << result["tiles_loaded"] << " of "
       << result["tiles_wanted"] << " tiles" << (result["complete"].get<bool>() ? " (complete)" : " (INCOMPLETE)")
       << ", " << result["voxels_occupied"] << " voxels of " << rounded(result["voxel_size"]) << " m occupied, "
       << result["surface_points"] << " surface points\n";
  for (const auto& warning : result["warnings"]) text << "note: " << warning.get<std::string>() << "\n";
  return text.str();
}

std::string dry_run_summary(const nlohmann::json& result) {
  return "an estimate, from " + std::to_string(result["tiles_probed"].get<int>()) +
         " tiles: " + result["text"].get<std::string>() +
         (result["in_blocks"].get<bool>() ? "; in blocks, memory is less" : "") + "; nothing is written\n";
}

/// Edge of a block: 0 for `auto`, nullopt if it is neither that nor a length above zero.
std::optional<double> block_edge_m(const std::string& text) {
  if (text == "auto") return 0.0;
  double edge_m = 0.0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), edge_m);
  const bool is_length = fault == std::errc() && end == text.data() + text.size() && std::isfinite(edge_m);
  return is_length && edge_m > 0.0 ? std::optional(edge_m) : std::nullopt;
}

std::string block_fault(const std::string& text) {
  return block_edge_m(text) ? "" : "must be a length above zero, in metres, or auto, got " + text;
}

}  // namespace

void add_extract(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<ExtractOptions>();
  CLI::App* command = app.add_subcommand("extract", "ground truth of a region: mesh, surface points, voxels");
  command->footer(
      "Example:\n  tileflight extract tiles/tileset.json --center 35.310344,-80.740007,215 --size 250,250,60 --out "
      "truth");
  command->add_option("SOURCE", options->source, kSourceHelp)->required();
  add_region_options(*command, options->region);
  command->add_option("--voxel", options->voxel_m, "edge of a voxel, metres (default 1)")->check(CLI::PositiveNumber);
  command
      ->add_option("--block", options->block,
                   "make the truth in blocks of this edge, metres, or `auto` (by memory): memory then depends on the "
                   "block, not on the region")
      ->check(block_fault, "METRES|auto");
  command
      ->add_option("--memory", options->memory_gb,
                   "memory that the extraction may take, GB (default: what is available); more is refused at once")
      ->check(CLI::PositiveNumber);
  command->add_flag("--dry-run", options->dry_run, "print what it would take, and write nothing");
  command->add_option("--out", options->out, "folder to write")->required();
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      place::ExtractSettings settings{
          .source = options->source, .load = load_options(options->region), .voxel_m = options->voxel_m};
      if (!options->block.empty()) settings.block_m = block_edge_m(options->block);
      settings.load.source = source_options(options->source_arguments);
      if (options->memory_gb > 0.0) settings.max_memory_bytes = static_cast<std::uintmax_t>(options->memory_gb * 1e9);
      if (options->dry_run) {
        const nlohmann::json cost = place::preview_extract(settings, options->out, shared.force, progress);
        return {cost, dry_run_summary(cost)};
      }
      const nlohmann::json result = place::extract(settings, options->out, shared.force, progress);
      return {result, extract_summary(result, options->out)};
    };
  });
}

}  // namespace tileflight::app
