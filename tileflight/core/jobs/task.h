#pragma once

#include <string>
#include <vector>

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

/// How tasks are run.
struct TaskOptions {
  int jobs = 1;               ///< tasks that run at the same time
  int cores = 1;              ///< of this machine
  bool slurm = false;         ///< tasks are submitted to Slurm
  bool use_snakemake = true;  ///< if it is installed
};

}  // namespace tileflight::jobs
