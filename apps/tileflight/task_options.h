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
  /// Tasks at once.
  int at_once() const;
  /// Processes that share this machine's memory.
  int on_this_machine() const { return slurm ? 1 : at_once(); }
  /// A good number of parts: some for each task that runs at once, so that none waits long for the last one.
  int parts() const { return 8 * at_once(); }
};

/// `parts`: what the tasks make, for the help ("blocks").
void add_task_options(CLI::App& command, TaskArguments& arguments, const std::string& parts);

/// Runs a job whose parts and last call are given by the words that they have in addition to the command line's own;
/// `replaced`: valued options of the command line that these words replace.
nlohmann::json run_in_tasks(jobs::PartedJob job, const TaskArguments& arguments, const CommonOptions& common,
                            const std::vector<std::string>& replaced, const Progress& progress);

}  // namespace tileflight::app
