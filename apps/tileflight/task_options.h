#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "tileflight/core/jobs/parted_job.h"

namespace tileflight::app {

/// Command-line options of a command whose work can be done in tasks.
struct TaskArguments {
  int jobs = 0;  ///< 0: not given
  bool slurm = false;
  bool use_snakemake = true;

  bool wanted() const { return jobs > 0 || slurm; }
  /// Number of tasks that run at once.
  int at_once() const;
  /// Number of tasks that share this machine's memory.
  int on_this_machine() const { return slurm ? 1 : at_once(); }
  /// Number of parts to divide the work into: several for each task that runs at once, so that no task waits long for
  /// the last one.
  int parts() const { return 8 * at_once(); }
};

/// Adds the options. `parts` names what the tasks make, for the help ("the blocks").
void add_task_options(CLI::App& command, TaskArguments& arguments, const std::string& parts);

/// Runs a job in tasks that call this command again. The words of the job's parts and of its last call are added to the
/// words of the command line. `replaced` names options with a value that these words replace.
nlohmann::json run_in_tasks(jobs::PartedJob job, const TaskArguments& arguments, const CommonOptions& common,
                            const std::vector<std::string>& replaced, const Progress& progress);

}  // namespace tileflight::app
