#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/task.h"

namespace tileflight::jobs {

/// Writes a file unless it has this content already: tasks are repeated if an input is newer. Throws InputError.
void write_if_changed(const std::filesystem::path& file, const std::string& text);

/// The file that a task's script creates when it has finished: "done/NAME".
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
