#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "command.h"
#include "number_text.h"
#include "tileflight/experiments/study/run_study.h"

namespace tileflight::app {
namespace {

using nlohmann::json;

struct StudyCommandOptions {
  std::string study, out;
  std::filesystem::path places;
  jobs::TaskOptions run;
  bool dry_run = false;
};

std::string study_text(const json& study, const std::string& out) {
  std::ostringstream text;
  for (const json& ranked : study["ranking"]) {
    text << study["systems"][ranked["system"].get<std::string>()]["title"].get<std::string>() << ": score "
         << rounded(ranked["score"], 3);
    if (ranked["interval"][0].is_number()) text << ", 95 % interval " << rounded_list(ranked["interval"]);
    text << ", " << ranked["flights"] << " flights\n";
  }
  if (!study["kendall_tau"].is_null())
    text << "Kendall's tau between simulation and second flights: " << rounded(study["kendall_tau"]["value"]) << "\n";
  for (const json& warning : study["warnings"]) text << "warning: " << warning["message"].get<std::string>() << "\n";
  text << "page: " << (std::filesystem::absolute(out) / "study.html").lexically_normal().string() << "\n";
  return text.str();
}

}  // namespace

void add_study(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto options = std::make_shared<StudyCommandOptions>();
  CLI::App* command = app.add_subcommand("study", "compare SLAM systems over places, flights, cameras and repetitions");
  command->footer(
      "Example:\n  tileflight study examples/study.yaml --out out/study --dry-run\n"
      "  tileflight study examples/study.yaml --out out/study --jobs 2");
  command->add_option("STUDY", options->study, "study file (YAML)")->required();
  command->add_option("--out", options->out, "folder for study.json, study.html and all results")->required();
  command->add_option("--places", options->places,
                      "folder of the places' truths and datasets, shared by studies (default: OUT/places)");
  command->add_option("--jobs", options->run.jobs, "tasks at once (default 1: times are comparable)")
      ->check(CLI::Range(1, 10000));
  command->add_flag("--dry-run", options->dry_run, "print the plan only");
  command->add_flag("--slurm", options->run.slurm, "submit the tasks to Slurm (needs Snakemake)");
  command
      ->add_flag("--no-snakemake{false}", options->run.use_snakemake,
                 "run the tasks one after the other, also where Snakemake is installed")
      ->excludes(command->get_option("--slurm"));
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions& shared, const Progress& progress) -> Output {
      const study::StudyFile file = study::read_study(options->study);
      const int cores =
          shared.threads > 0 ? shared.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
      const study::PlanOptions folders{.out = options->out,
                                       .places = options->places,
                                       .jobs = options->run.slurm ? 1 : options->run.jobs,
                                       .cores = cores};
      const study::StudyPlan plan = study::make_plan(file, folders);
      if (options->dry_run) return {study::describe_plan(plan), study::plan_text(plan)};
      if (!shared.json && !shared.quiet) std::cout << study::plan_text(plan) << std::flush;
      const json result = study::run_study(plan, folders, options->run, progress);
      return {result, study_text(result, options->out)};
    };
  });
}

}  // namespace tileflight::app
