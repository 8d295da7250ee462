#include "tileflight/experiments/study/run_study.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/build_folder.h"
#include "tileflight/core/jobs/run_tasks.h"
#include "tileflight/experiments/study/study_results.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

void write_plan(const StudyPlan& plan, const fs::path& folder) {
  jobs::write_if_changed(folder / "study.yaml", base::read_text(plan.study.file));
  jobs::write_if_changed(folder / "settings.yaml", "# For align and evaluate.\n" + plan.study.settings);
  jobs::write_if_changed(folder / "plan.json", describe_plan(plan).dump(2) + "\n");
  jobs::write_tasks(plan.tasks, folder, "tileflight study");
}

}  // namespace

json run_study(const StudyPlan& plan, const PlanOptions& folders, const jobs::TaskOptions& options,
               const Progress& progress) {
  if (fs::exists(folders.out) && !fs::is_empty(folders.out) && !is_study_folder(folders.out))
    throw InputError(folders.out.string(), "holds something else than a study; choose another folder for --out");
  base::make_folder(folders.out);
  const jobs::FolderLock lock(folders.out);
  write_plan(plan, folders.out);
  jobs::TaskOptions on_cores = options;
  on_cores.cores = folders.cores;
  jobs::run_tasks(plan.tasks, folders.out, on_cores, progress);
  return write_study_report(folders.out);
}

}  // namespace tileflight::study
