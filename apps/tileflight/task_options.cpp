#include "task_options.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <thread>

namespace tileflight::app {

int TaskArguments::at_once() const {
  constexpr int kOnSlurm = 16;
  return jobs > 0 ? jobs : slurm ? kOnSlurm : 1;
}

void add_task_options(CLI::App& command, TaskArguments& arguments, const std::string& parts) {
  const std::string group = "Several processes";
  command
      .add_option("--jobs", arguments.jobs,
                  "make " + parts +
                      " in tasks of a Snakemake workflow, this many at once (without Snakemake one after "
                      "the other)")
      ->check(CLI::Range(1, 10000))
      ->group(group);
  CLI::Option* slurm =
      command
          .add_flag("--slurm", arguments.slurm, "submit these tasks to Slurm (needs Snakemake), by default 16 at once")
          ->group(group);
  command
      .add_flag("--no-snakemake{false}", arguments.use_snakemake,
                "run the tasks one after the other, also where Snakemake is installed")
      ->excludes(slurm)
      ->group(group);
}

nlohmann::json run_in_tasks(jobs::PartedJob job, const TaskArguments& arguments, const CommonOptions& common,
                            const std::vector<std::string>& replaced, const Progress& progress) {
  std::vector<std::string> valued = replaced;
  valued.insert(valued.end(), {"--jobs", "--threads"});
  const std::vector<std::string> words = jobs::without_options(
      common.arguments, {"--json", "--quiet", "--force", "--resume", "--slurm", "--no-snakemake"}, valued);
  const auto complete = [&](jobs::PartedJob::Call& call) {
    call.words.insert(call.words.begin(), words.begin(), words.end());
  };
  for (jobs::PartedJob::Call& part : job.parts) complete(part);
  complete(job.last);
  const int cores =
      common.threads > 0 ? common.threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  job.threads = std::max(1, cores / arguments.on_this_machine());
  return run_parted_job(
      job,
      {.jobs = arguments.at_once(), .cores = cores, .slurm = arguments.slurm, .use_snakemake = arguments.use_snakemake},
      progress);
}

}  // namespace tileflight::app
