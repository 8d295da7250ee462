#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <sstream>

#include "command.h"
#include "input_options.h"
#include "number_text.h"
#include "task_options.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/memory_budget.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/experiments/experiment/experiment_file.h"

namespace tileflight::app {
namespace {

/// The options given, and the content of the files they name; without options that do not affect the images and those
/// that may be secret.
nlohmann::json asked(const CLI::App& command) {
  const std::set<std::string> left_out{"out",      "threads", "json",  "quiet",  "force",
                                       "resume",   "memory",  "cache", "header", "allow-host",
                                       "no-cache", "frames",  "jobs",  "slurm",  "no-snakemake"};
  nlohmann::json options = nlohmann::json::object();
  for (const CLI::Option* option : command.get_options()) {
    const std::string name = option->get_single_name();
    if (option->count() == 0 || left_out.contains(name)) continue;
    for (const std::string& value : option->results()) {
      options[name].push_back(value);
      if (std::filesystem::is_regular_file(value)) options[name].push_back(base::sha256_hex_of_file(value));
    }
  }
  return options;
}

/// "100:200"; nullopt if the text is no range.
std::optional<jobs::IndexRange> frame_range(const std::string& text) {
  jobs::IndexRange range;
  const char* const end = text.data() + text.size();
  const auto [colon, fault] = std::from_chars(text.data(), end, range.begin);
  if (fault != std::errc() || colon == end || *colon != ':') return std::nullopt;
  const auto [last, other_fault] = std::from_chars(colon + 1, end, range.end);
  const bool is_range = other_fault == std::errc() && last == end && range.begin < range.end;
  return is_range ? std::optional(range) : std::nullopt;
}

std::string frame_range_fault(const std::string& text) {
  return frame_range(text) ? "" : "must be the first frame and the one after the last, as in 0:100, got " + text;
}

/// Returns what is wrong with a width or a height of --resolution; empty: nothing.
std::string pixel_count_fault(const std::string& text) {
  const bool is_count = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos;
  return is_count ? "" : "must be W,H in pixels, as in 640,480, got " + text;
}

/// The frames in ranges, each a task, and a task that finishes the dataset.
nlohmann::json render_in_tasks(const recording::RenderSettings& settings, const std::string& out,
                               const TaskArguments& tasks, const CommonOptions& common, const Progress& progress) {
  if (!jobs::has_finished_tasks(out, "finish"))
    base::require_writable(recording::render_output(settings, out, common.force));
  const recording::FramePlan plan = recording::plan_frame_parts(settings, tasks.parts(), progress);
  const double memory_gb = 1e-9 * static_cast<double>(settings.max_memory_bytes.value_or(
                                      base::default_memory_bytes() / static_cast<unsigned>(tasks.on_this_machine())));
  const std::vector<std::string> memory{"--memory", base::fixed_text(memory_gb)};
  jobs::PartedJob job{.output = out,
                      .build_folder = recording::frame_build_folder(out),
                      .command = "render",
                      .parts = {},
                      .last = {"finish", memory},
                      .inputs_sha256 = plan.inputs_sha256};
  job.last.words.insert(job.last.words.end(), {"--resume", "--force"});
  for (const jobs::IndexRange& part : plan.parts) {
    const std::string begin = std::to_string(part.begin), end = std::to_string(part.end);
    job.parts.push_back({"frames-" + begin + "-" + end, memory});
    job.parts.back().words.insert(job.parts.back().words.end(), {"--frames", begin + ":" + end});
  }
  // Besides tiles, the program takes some, for images under way above all.
  job.memory_mb = static_cast<int>(std::min(1e6, 1000.0 + 1200.0 * memory_gb));
  return run_in_tasks(job, tasks, common, {"--memory"}, progress);
}

std::string render_summary(const nlohmann::json& r, const std::string& out) {
  std::ostringstream text;
  text << out << ": " << r["frames"] << " frames, " << rounded(r["frames_per_second"], 3) << " per second\n";
  if (const auto events = r["events"].get<std::uint64_t>(); events > 0) text << events << " events\n";
  for (const auto& warning : r["warnings"]) text << "note: " << warning.get<std::string>() << "\n";
  return text.str();
}

std::string part_of_frames_summary(const recording::RenderedPart& part) {
  std::ostringstream text;
  text << part.frames_rendered << " of these " << part.frames << " frames rendered, kept in "
       << part.build_folder.string() << "\n";
  return text.str();
}

struct RenderArguments {
  RegionOptions region;
  SourceArguments source_arguments;
  recording::RenderSettings settings;
  std::string flight, out, outputs, degrade, camera, frames;
  TaskArguments tasks;
  std::vector<int> resolution;
  bool depth = false;
  std::optional<double> pixel_error, memory_gb;
};

/// Completes the settings by the command line and the files that it names. With --pixel-error, tiles are those of the
/// flight's views although a region is given.
void complete_settings(RenderArguments& options, const CLI::App& command) {
  options.settings.asked = asked(command);
  options.settings.fly_autopilot = autopilot_flyer();
  options.settings.load = load_options(options.region);
  options.settings.load.source = source_options(options.source_arguments);
  const bool has_region = options.settings.load.center || options.settings.load.center_local;
  if (options.pixel_error || !has_region) options.settings.error_px = options.pixel_error.value_or(1.0);
  options.settings.flight.flight = options.flight;
  options.settings.flight.camera = options.camera;
  options.settings.inputs = {options.degrade};
  recording::RenderOutputs& outputs = options.settings.flight.outputs;
  outputs =
      recording::parse_outputs(options.outputs, [](const std::string& what) { return InputError("--outputs", what); });
  outputs.depth = outputs.depth || options.depth;
  if (!options.degrade.empty()) {
    auto degrade = base::StrictSection::load(options.degrade);
    experiment::read_degrade(degrade, options.settings.flight);
  }
}

void add_image_options(CLI::App& command, RenderArguments& options) {
  command.add_option("--camera", options.camera,
                     "calibration instead of the flight's: Kalibr, OpenCV, COLMAP, DSO or VSLAM-LAB");
  command
      .add_option("--resolution", options.resolution,
                  "W,H of the images, pixels: rescales the camera (same aspect ratio)")
      ->delimiter(',')
      ->expected(2)
      ->check(pixel_count_fault)
      ->check(CLI::Range(16, 65536));
  command.add_option("--max-frames", options.settings.flight.max_frames, "render at most this many frames")
      ->check(CLI::Range(2, 10000000));
  command
      .add_option("--samples", options.settings.flight.samples_per_pixel,
                  "samples per pixel: 1, 4, 9 or 16 (default 1)")
      ->check(CLI::IsMember({1, 4, 9, 16}));
  command.add_option("--outputs", options.outputs,
                     "additional images per frame, comma-separated: depth, range, normals, segmentation, "
                     "infrared, flow, visibility, photometric");
  command
      .add_option("--degrade", options.degrade,
                  "camera degradation: a YAML file with the keys of an experiment's `degrade`")
      ->check(CLI::ExistingFile);
  command.add_flag("--depth", options.depth, "the same as --outputs depth");
  command.add_flag("--png", options.settings.png, "images as PNG instead of JPEG");
  command.add_option("--seed", options.settings.seed, "random seed (default 1)");
}

/// Which part of the frames this process renders, and with how much memory.
void add_process_options(CLI::App& command, RenderArguments& options) {
  command
      .add_option("--pixel-error", options.pixel_error,
                  "load the tiles that the flight's views need at this screen-space error, "
                  "pixels, instead of a region (default 1, used when no region is given)")
      ->check(CLI::PositiveNumber);
  command
      .add_option("--memory", options.memory_gb,
                  "memory limit for tiles, GB, of each process (default: half of the machine's, "
                  "divided among its tasks); a flight that needs more is rendered in "
                  "several passes, with identical pixels")
      ->check(CLI::PositiveNumber);
  command.add_flag("--resume", options.settings.resume,
                   "keep finished frames beside the output until it is complete, and reuse those of an interrupted "
                   "render; always on where such frames exist");
  CLI::Option* frames =
      command
          .add_option("--frames", options.frames,
                      "render only the frames from A to before B and keep them beside the output, for a job of your "
                      "own; the same command with --resume instead finishes the dataset")
          ->check(frame_range_fault, "A:B");
  add_task_options(command, options.tasks, "ranges of frames");
  for (const char* name : {"--jobs", "--slurm"}) command.get_option(name)->excludes(frames);
}

Output render(RenderArguments& options, const CommonOptions& shared, const Progress& progress) {
  if (options.tasks.wanted()) {
    const nlohmann::json r = render_in_tasks(options.settings, options.out, options.tasks, shared, progress);
    return {r, render_summary(r, options.out)};
  }
  if (const std::optional<jobs::IndexRange> range = frame_range(options.frames)) {
    const recording::RenderedPart part = recording::render_part(options.settings, *range, options.out, progress);
    return {recording::to_json(part), part_of_frames_summary(part)};
  }
  const nlohmann::json r =
      recording::to_json(recording::render_dataset(options.settings, options.out, shared.force, progress));
  return {r, render_summary(r, options.out)};
}

}  // namespace

void add_render(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<RenderArguments>();
  CLI::App* command = app.add_subcommand("render", "render a flight over tiles as a simulated sensor dataset");
  command->footer(
      "Example:\n  tileflight render tiles/tileset.json --flight examples/machangara-flight-simulated.yaml --out "
      "dataset\nSeveral processes share the frames:\n  tileflight render ... --jobs 4\n  tileflight render ... --slurm "
      "--jobs 40");
  command->add_option("SOURCE", options->settings.source, kSourceHelp)->required();
  command
      ->add_option(
          "--flight", options->flight,
          "flight file (YAML): camera, trajectory or waypoints, fps; or a mission (QGroundControl, DJI, Litchi, KML)")
      ->required();
  command->add_option("--out", options->out, "dataset folder to write")->required();
  add_image_options(*command, *options);
  add_process_options(*command, *options);
  add_region_options(*command, options->region);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, command, &selection] {
    if (!options->resolution.empty()) {
      options->settings.flight.width = options->resolution[0];
      options->settings.flight.height = options->resolution[1];
    }
    if (options->memory_gb) options->settings.max_memory_bytes = static_cast<std::uintmax_t>(*options->memory_gb * 1e9);
    selection.run = [options, command](const CommonOptions& shared, const Progress& progress) {
      complete_settings(*options, *command);
      return render(*options, shared, progress);
    };
  });
}

}  // namespace tileflight::app
