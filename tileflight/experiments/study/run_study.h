#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/run_tasks.h"
#include "tileflight/experiments/study/study_plan.h"

namespace tileflight::study {

/// Writes the plan into the study's folder as a Snakemake workflow (Snakefile, tasks/, plan.json), starts it, and
/// returns study.json. Tasks whose inputs have not changed are skipped, also after a crash. Without
/// Snakemake the tasks run one after the other. Throws InputError if a task failed (naming it and its log), if another
/// process works in the folder, and if Slurm is wanted without Snakemake.
nlohmann::json run_study(const StudyPlan& plan, const PlanOptions& folders, const jobs::TaskOptions& options,
                         const Progress& progress = {});

}  // namespace tileflight::study
