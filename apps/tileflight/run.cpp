#include "tileflight/experiments/experiment/run.h"

#ifdef __linux__
#include <malloc.h>
#endif
#include <algorithm>
#include <nlohmann/json.hpp>
#include <tuple>

#include "command.h"
#include "input_options.h"
#include "project_options.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/experiments/report/ablation_table.h"
#include "tileflight/experiments/report/map_comparison_tables.h"
#include "tileflight/experiments/report/report.h"
#include "tileflight/slam/external_systems/adapter.h"
#include "warnings_text.h"

namespace tileflight::app {
namespace {

void replace_cameras(experiment::Experiment& experiment, const std::filesystem::path& camera) {
  if (camera.empty()) return;
  for (auto* flight : {&experiment.simulated, &experiment.real}) {
    if (*flight && (*flight)->render && !(*flight)->render->follows_real)
      (*flight)->render->camera = std::filesystem::absolute(camera);
  }
}

/// Gives large blocks pages of their own, which go back to the system as soon as they are freed. By default glibc comes
/// to keep blocks of up to 32 MB in its threads' arenas, where images leave gaps: the odometry of 100 frames of 2688 x
/// 1512 took 1.5 GB in a run that had rendered them, and takes 0.87 GB so.
void give_large_blocks_own_pages() {
#ifdef __GLIBC__
  constexpr int kOwnPages_bytes = 4 << 20;
  mallopt(M_MMAP_THRESHOLD, kOwnPages_bytes);
#endif
}

/// Tells whether a recording is given in place of an experiment.
bool is_recording(const std::filesystem::path& file) {
  const std::string ending = file.extension().string();
  return std::filesystem::is_directory(file) ||
         (ending != ".yaml" && ending != ".yml" && std::filesystem::exists(file));
}

/// Throws InputError if an experiment uses another system than the one that was given.
void require_system(const std::filesystem::path& file, const std::optional<external_systems::Adapter>& given) {
  if (!given) return;
  const std::optional<external_systems::Adapter> own = experiment::read_experiment(file).odometry.system;
  if (!own || own->folder != given->folder)
    throw InputError(file.string(), "was made without `--system " + given->name + "`: write `system: " + given->name +
                                        "` in its section odometry, in place of the keys there, or make it again by "
                                        "--force");
}

/// Makes the project of a recording in OUT/project, unless it is there, where the user may have changed it. Returns its
/// experiment and what to say of it.
std::pair<std::filesystem::path, std::string> project_of(const std::vector<std::filesystem::path>& parts,
                                                         const std::filesystem::path& out,
                                                         const ProjectArguments& arguments,
                                                         const SourceArguments& source, bool replace,
                                                         const Progress& progress) {
  const std::filesystem::path folder = out / "project", experiment = folder / "experiment.yaml";
  std::optional<external_systems::Adapter> system;
  if (!arguments.system.empty()) system = external_systems::find_adapter(arguments.system);
  if (system) external_systems::require_installed(*system);
  if (std::filesystem::exists(experiment) && !replace) {
    require_system(experiment, system);
    return {experiment, "project: " + experiment.string() + " as it is (--force makes it again)\n\n"};
  }
  const project::ProjectOptions options = project_options(arguments, parts, source);
  try {
    const project::Project made = project::make_project(options, folder, replace, progress);
    return {made.experiment, project_text(made) + "\n"};
  } catch (const InputError&) {
    std::error_code ignored;
    std::filesystem::remove(out, ignored);  // only if it is empty
    throw;
  }
}

}  // namespace

void add_run(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::vector<std::filesystem::path> files;
    std::string out;
    SourceArguments source_arguments;
    std::string until;
    std::vector<std::string> flights;
    std::string truth_cache;
    ProjectArguments project;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("run", "run an experiment, from tiles to report");
  command->footer(
      "Example:\n  tileflight run examples/stadium.yaml --out out/stadium\n"
      "  tileflight run DJI_0042.MP4 --place tiles --out results\n"
      "  tileflight run GH010042.MP4 GH020042.MP4 --place tiles --from 20 --to 90 --out results");
  command
      ->add_option("EXPERIMENT", options->files,
                   "experiment file (YAML); or a video, the parts of one recording or a folder of photos, whose "
                   "project is made in OUT/project first, as `new` does")
      ->required();
  command->add_option("--out", options->out,
                      "folder for results.json, report.html and all intermediate results (default for a video: its "
                      "name in this folder)");
  command->add_option("--until", options->until, "datasets: stop when the truth and the flights' datasets are there")
      ->check(CLI::IsMember({"datasets"}));
  command->add_option("--flight", options->flights, "with --until: only this flight (repeated: these)")
      ->check(CLI::IsMember({"simulated", "real"}))
      ->needs(command->get_option("--until"));
  command->add_option("--truth-cache", options->truth_cache,
                      "folder of truths and built-in places that runs share: each is made once for the same tiles and "
                      "settings, found by content. It may be removed at any time");
  add_project_options(*command, options->project);
  command->get_option("--camera")
      ->description(
          "calibration: of a video its own; of an experiment that of the rendered flights, instead of their own")
      ->check(CLI::ExistingFile);
  add_source_options(*command, options->source_arguments);
  add_common_options(*command, common);
  command->callback([options, command, &selection] {
    const std::filesystem::path& first = options->files.front();
    const bool makes_project = std::ranges::all_of(options->files, is_recording);
    if (!makes_project && options->files.size() > 1)
      throw CLI::ValidationError(std::ranges::find_if_not(options->files, is_recording)->string(),
                                 "is no video: give the parts of one recording, or one experiment file");
    if (!makes_project) {
      if (options->out.empty()) throw CLI::RequiredError("--out");
      for (const char* name :
           {"--place", "--origin", "--profiles", "--fov", "--telemetry", "--imu", "--from", "--to", "--system"})
        if (command->count(name) > 0)
          throw CLI::ValidationError(name, "is for a video or photos; an experiment file has it as a key");
    } else if (options->out.empty()) {
      options->out = first.lexically_normal().stem().string() + "-results";
    }
    selection.run = [options, makes_project](const CommonOptions& shared, const Progress& progress) -> Output {
      give_large_blocks_own_pages();
      std::string made;
      std::filesystem::path file = options->files.front();
      if (makes_project)
        std::tie(file, made) = project_of(options->files, options->out, options->project, options->source_arguments,
                                          shared.force, progress);
      experiment::Experiment experiment = experiment::read_experiment(file);
      experiment.source_options = source_options(options->source_arguments);
      if (!makes_project) replace_cameras(experiment, options->project.camera);
      const nlohmann::json results = experiment::run(experiment, options->out, progress,
                                                     {.rerun_all = shared.force,
                                                      .listener = shared.stages,
                                                      .truth_cache = options->truth_cache,
                                                      .until_datasets = !options->until.empty(),
                                                      .flights = options->flights,
                                                      .fly_autopilot = autopilot_flyer()});
      if (results.is_null()) return {{{"out", options->out}}, options->out + ": truth and datasets are there\n"};
      const std::string report = (std::filesystem::absolute(options->out) / "report.html").lexically_normal().string();
      std::string text = made + report::results_table(results);
      for (const std::string& part : {report::map_comparison_text(results), report::ablation_text(results)}) {
        if (!part.empty()) text += "\n" + part;
      }
      if (const std::string warnings = warnings_text(results); !warnings.empty()) text += "\n" + warnings;
      return {results, text + "\nreport: " + report + "\n"};
    };
  });
}

}  // namespace tileflight::app
