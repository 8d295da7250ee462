#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"

namespace tileflight::jobs {

/// A step of a workflow: a shell script that is run in the workflow's folder when an output is missing or older than an
/// input.
struct Task {
  std::string name;    ///< also of its script: tasks/NAME.sh
  std::string script;  ///< whole text
  /// Files, relative to the workflow's folder. The output is a marker file, done/NAME, not the results themselves:
  /// Snakemake removes a task's outputs before running it, and another workflow may be reading the results.
  std::vector<std::string> inputs, outputs;
  int threads = 1;
  int memory_mb = 4000;
  int minutes = 120;
};

/// Options for running tasks.
struct TaskOptions {
  int jobs = 1;               ///< tasks that run at the same time
  int cores = 1;              ///< of this machine
  bool slurm = false;         ///< tasks are submitted to Slurm
  bool use_snakemake = true;  ///< if it is installed
};

/// Writes a file unless it has this content already: tasks are repeated if an input is newer. Throws InputError.
void write_if_changed(const std::filesystem::path& file, const std::string& text);

/// Returns the file that a task's script creates when it has finished: "done/NAME".
std::string marker_of(const std::string& task);

/// Writes tasks into a folder as a Snakemake workflow: Snakefile, tasks/, logs/, done/. The last task is the workflow's
/// target. `made_by`: the command, for the Snakefile's first line. Throws InputError.
void write_tasks(const std::vector<Task>& tasks, const std::filesystem::path& folder, const std::string& made_by);

/// Runs the tasks that write_tasks() wrote, in an order that respects their inputs: through Snakemake, here or on
/// Slurm, or, without it, one after the other as they are listed. Tasks whose inputs have not changed are skipped, also
/// after a crash. Throws InputError if a task failed (naming it and its log), and if Slurm is wanted
/// without Snakemake.
void run_tasks(const std::vector<Task>& tasks, const std::filesystem::path& folder, const TaskOptions& options,
               const Progress& progress = {});

}  // namespace tileflight::jobs
