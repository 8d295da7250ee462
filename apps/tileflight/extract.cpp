#include "tileflight/world/place/extract.h"

#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "command.h"
#include "input_options.h"
#include "number_text.h"
#include "task_options.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/world/place/block_plan.h"
#include "tileflight/world/place/truth_blocks.h"

namespace tileflight::app {
namespace {

struct ExtractOptions {
  std::string source;
  RegionOptions region;
  SourceArguments source_arguments;
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
  std::string block;
  std::string part;
  bool resume = false;
  TaskArguments tasks;
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
  if (!result.contains("build")) return text.str();
  const nlohmann::json& build = result["build"];
  if (build["blocks_reused"] > 0)
    text << "note: " << build["blocks_reused"] << " of " << build["blocks"]
         << " blocks were reused from an earlier extract\n";
  if (build.contains("note")) text << "note: " << build["note"].get<std::string>() << "\n";
  return text.str();
}

std::string part_summary(const nlohmann::json& build, const std::string& out) {
  std::ostringstream text;
  text << "part " << build["part"][0] << " of " << build["part"][1] << " of " << out << ": " << build["blocks_made"]
       << " blocks made, " << build["blocks_reused"] << " of all " << build["blocks"] << " were there\n";
  return text.str();
}

/// Reads a part, such as "2/8"; nullopt for other texts.
std::optional<place::JobPart> job_part(const std::string& text) {
  place::JobPart part;
  const char* const end = text.data() + text.size();
  const auto [slash, fault] = std::from_chars(text.data(), end, part.number);
  if (fault != std::errc() || slash == end || *slash != '/') return std::nullopt;
  const auto [last, other_fault] = std::from_chars(slash + 1, end, part.count);
  const bool is_part = other_fault == std::errc() && last == end && part.number >= 1 && part.number <= part.count;
  return is_part ? std::optional(part) : std::nullopt;
}

std::string part_fault(const std::string& text) {
  return job_part(text) ? "" : "must be two numbers from 1, as in 2/8, got " + text;
}

std::string dry_run_summary(const place::ExtractPreview& preview) {
  return "an estimate, from " + std::to_string(preview.cost.tiles_probed) + " tiles: " + cost_text(preview.cost) +
         (preview.in_blocks ? "; in blocks, memory is less" : "") + "; nothing is written\n";
}

/// Reads the edge of a block, metres; 0 for `auto`, nullopt for a text that is neither that nor a length above zero.
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

/// Makes groups of blocks as tasks, and joins them in a last task.
nlohmann::json extract_in_tasks(place::ExtractSettings settings, const ExtractOptions& options,
                                const CommonOptions& common, const Progress& progress) {
  if (!jobs::has_finished_tasks(options.out, "join"))
    base::require_writable(place::extract_output(settings, options.out, common.force));
  settings.processes = options.tasks.on_this_machine();
  const place::BlockPlan plan = place::plan_truth_blocks(settings, options.out, options.tasks.parts());
  const std::vector<std::string> edge{"--block", base::fixed_text(plan.edge_m)};
  jobs::PartedJob job{.output = options.out,
                      .build_folder = place::block_build_folder(options.out),
                      .command = "extract",
                      .parts = {},
                      .last = {"join", edge},
                      .inputs_sha256 = plan.inputs_sha256};
  job.last.words.insert(job.last.words.end(), {"--resume", "--force"});
  for (int k = 1; k <= plan.parts; ++k) {
    const std::string of = std::to_string(plan.parts);
    job.parts.push_back({"blocks-" + std::to_string(k) + "-of-" + of, edge});
    job.parts.back().words.insert(job.parts.back().words.end(), {"--part", std::to_string(k) + "/" + of});
  }
  // The estimate covers a part of the contents only, and the program itself takes some memory.
  job.memory_mb = static_cast<int>(std::min(1e6, 500.0 + 1.5e-6 * plan.memory_bytes));
  return run_in_tasks(job, options.tasks, common, {"--block"}, progress);
}

void add_block_options(CLI::App& command, ExtractOptions& options) {
  command
      .add_option("--block", options.block,
                  "make the truth in blocks of this edge, metres, or `auto` (by memory): memory then depends on the "
                  "block, not on the region")
      ->check(block_fault, "METRES|auto");
  CLI::Option* part =
      command
          .add_option("--part", options.part,
                      "make only the K-th of N parts of the blocks and keep them beside the output, for a job of your "
                      "own; the same command with --resume instead joins them")
          ->check(part_fault, "K/N")
          ->needs("--block");
  command
      .add_flag(
          "--resume", options.resume,
          "keep finished blocks beside the output until it is complete, and reuse those of an interrupted extract; "
          "always on where such blocks exist")
      ->needs("--block");
  add_task_options(command, options.tasks, "the blocks");
  for (const char* name : {"--jobs", "--slurm"}) command.get_option(name)->needs("--block")->excludes(part);
}

Output extract(const ExtractOptions& options, const CommonOptions& shared, const Progress& progress) {
  place::ExtractSettings settings{.source = options.source,
                                  .load = load_options(options.region),
                                  .voxel_m = options.voxel_m,
                                  .samples_per_m2 = options.samples_per_m2};
  if (!options.block.empty()) settings.block_m = block_edge_m(options.block);
  settings.load.source = source_options(options.source_arguments);
  if (options.memory_gb > 0.0) settings.max_memory_bytes = static_cast<std::uintmax_t>(options.memory_gb * 1e9);
  if (options.dry_run) {
    const place::ExtractPreview preview = place::preview_extract(settings, options.out, shared.force, progress);
    return {to_json(preview), dry_run_summary(preview)};
  }
  settings.resume = options.resume;
  settings.part = job_part(options.part);
  if (options.tasks.wanted()) {
    const nlohmann::json result = extract_in_tasks(settings, options, shared, progress);
    return {result, extract_summary(result, options.out)};
  }
  const nlohmann::json result = to_json(place::extract(settings, options.out, shared.force, progress));
  if (settings.part) return {result, part_summary(result["build"], options.out)};
  return {result, extract_summary(result, options.out)};
}

}  // namespace

void add_extract(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<ExtractOptions>();
  CLI::App* command = app.add_subcommand("extract", "ground truth of a region: mesh, surface points, voxels");
  command->footer(
      "Example:\n  tileflight extract tiles/tileset.json --center 35.310344,-80.740007,215 --size 250,250,60 --out "
      "truth\nSeveral processes share the blocks of a large region:\n  tileflight extract ... --block 400 --jobs 4\n  "
      "tileflight extract ... --block 400 --slurm --jobs 40");
  command->add_option("SOURCE", options->source, kSourceHelp)->required();
  add_region_options(*command, options->region);
  command->add_option("--voxel", options->voxel_m, "edge of a voxel, metres (default 1)")->check(CLI::PositiveNumber);
  command
      ->add_option("--samples", options->samples_per_m2,
                   "surface points per square metre (default 16); fewer take less memory and disk")
      ->check(CLI::PositiveNumber);
  add_block_options(*command, *options);
  command
      ->add_option(
          "--memory", options->memory_gb,
          "memory that the extraction may take, GB (default: what is available); what takes more by its estimate is "
          "refused, before it is read where that can be known")
      ->check(CLI::PositiveNumber);
  command->add_flag("--dry-run", options->dry_run, "print what it would take, and write nothing");
  command->add_option("--out", options->out, "folder to write")->required();
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) {
      return extract(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
