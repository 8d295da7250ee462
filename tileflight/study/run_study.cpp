#include "tileflight/study/run_study.h"

#include <nlohmann/json.hpp>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/make_folder.h"
#include "tileflight/study/study_results.h"
#include "tileflight/workflow/folder_lock.h"
#include "tileflight/workflow/run_tasks.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

void write_plan(const StudyPlan& plan, const fs::path& folder) {
  workflow::write_if_changed(folder / "study.yaml", base::read_text(plan.study.file));
  workflow::write_if_changed(folder / "settings.yaml", "# For align and evaluate.\n" + plan.study.settings);
  workflow::write_if_changed(folder / "plan.json", describe_plan(plan).dump(2) + "\n");
  workflow::write_tasks(plan.tasks, folder, "tileflight study");
}

}  // namespace

json run_study(const StudyPlan& plan, const PlanOptions& folders, const workflow::TaskOptions& options,
               const Progress& progress) {
  if (fs::exists(folders.out) && !fs::is_empty(folders.out) && !is_study_folder(folders.out))
    throw InputError(folders.out.string(), "holds something else than a study; choose another folder for --out");
  base::make_folder(folders.out);
  const workflow::FolderLock lock(folders.out);
  write_plan(plan, folders.out);
  workflow::TaskOptions on_cores = options;
  on_cores.cores = folders.cores;
  workflow::run_tasks(plan.tasks, folders.out, on_cores, progress);
  return write_study_report(folders.out);
}

}  // namespace tileflight::study
