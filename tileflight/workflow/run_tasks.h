#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/base/progress.h"
#include "tileflight/workflow/task.h"

namespace tileflight::workflow {

/// Leaves an equal file as it is: its time tells what must be done again. Throws InputError.
void write_if_changed(const std::filesystem::path& file, const std::string& text);

/// The marker that a task's script leaves: "done/NAME".
std::string marker_of(const std::string& task);

/// Writes tasks into a folder as a Snakemake workflow: Snakefile, tasks/, logs/, done/. The last task is the one that
/// is wanted. `made_by`: the command, for the Snakefile's first line. Throws InputError.
void write_tasks(const std::vector<Task>& tasks, const std::filesystem::path& folder, const std::string& made_by);

/// Runs the tasks that write_tasks() wrote, in an order that respects their inputs: through Snakemake, here or on
/// Slurm, or, without it, one after the other as they are listed. What was done before with the same inputs is not done
/// again, also after a crash. Throws InputError if a task failed (naming it and its log), and if Slurm is wanted
/// without Snakemake.
void run_tasks(const std::vector<Task>& tasks, const std::filesystem::path& folder, const TaskOptions& options,
               const Progress& progress = {});

}  // namespace tileflight::workflow
