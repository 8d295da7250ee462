#include "tileflight/core/jobs/parted_job.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/jobs/build_folder.h"
#include "tileflight/core/jobs/run_tasks.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

using base::shell_word;

constexpr const char* kResult = "result.json";

/// `redirect`: where its output goes, if anywhere.
Task task_of(const PartedJob& job, const PartedJob::Call& call, const fs::path& folder, const std::string& redirect) {
  Task task{.name = call.name,
            .script = "#!/bin/sh\n# inputs " + job.inputs_sha256.substr(0, 16) + "\nset -e\n: \"${TILEFLIGHT:=" +
                      base::program_path().string() + "}\"\ncd " + shell_word(fs::current_path()) + "\n\"$TILEFLIGHT\"",
            .inputs = {"tasks/" + call.name + ".sh"},
            .outputs = {marker_of(call.name)},
            .threads = job.threads,
            .memory_mb = job.memory_mb,
            .minutes = job.minutes};
  for (const std::string& word : call.words) task.script += " " + shell_word(word);
  task.script += " --threads " + std::to_string(job.threads) + redirect + "\ntouch " +
                 shell_word(folder / marker_of(call.name)) + "\n";
  return task;
}

std::vector<Task> tasks_of(const PartedJob& job, const fs::path& folder) {
  std::vector<Task> tasks;
  std::vector<std::string> markers;
  for (const PartedJob::Call& part : job.parts) {
    tasks.push_back(task_of(job, part, folder, " --quiet"));
    markers.push_back(marker_of(part.name));
  }
  tasks.push_back(task_of(job, job.last, folder, " --json > " + shell_word(folder / kResult)));
  tasks.back().inputs.insert(tasks.back().inputs.end(), markers.begin(), markers.end());
  return tasks;
}

void make_private_folder(const fs::path& folder) {
  base::make_folder(folder);
  std::error_code ignored;  // a file system without permissions
  fs::permissions(folder, fs::perms::owner_all, ignored);
}

}  // namespace

fs::path tasks_folder_of(const fs::path& output) { return BuildFolder::path_beside(output, "tasks"); }

bool has_finished_tasks(const fs::path& output, const std::string& last) {
  return fs::exists(tasks_folder_of(output) / marker_of(last));
}

nlohmann::json run_parted_job(const PartedJob& job, const TaskOptions& options, const Progress& progress) {
  const fs::path folder = tasks_folder_of(job.output);
  make_private_folder(folder);
  nlohmann::json result;
  {
    const FolderLock lock(folder);
    std::error_code ignored;
    // The parts are in the build folder until the output is there: without it, all are to be made again.
    const bool is_finished = has_finished_tasks(job.output, job.last.name);
    if (!fs::exists(is_finished ? job.output : job.build_folder)) fs::remove_all(folder / "done", ignored);
    const std::vector<Task> tasks = tasks_of(job, folder);
    write_tasks(tasks, folder, "tileflight " + job.command);
    run_tasks(tasks, folder, options, progress);
    result = nlohmann::json::parse(base::read_raw(folder / kResult), nullptr, false);
    if (result.is_discarded()) throw InputError((folder / kResult).string(), "is broken; run the command again");
  }
  std::error_code ignored_too;
  fs::remove_all(folder, ignored_too);
  return result;
}

std::vector<std::string> without_options(const std::vector<std::string>& words, const std::vector<std::string>& flags,
                                         const std::vector<std::string>& valued) {
  std::vector<std::string> kept;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (std::ranges::find(flags, word) != flags.end()) continue;
    if (std::ranges::find(valued, word) != valued.end()) {
      ++i;
      continue;
    }
    const bool has_value = std::ranges::any_of(valued, [&](const auto& name) { return word.starts_with(name + "="); });
    if (!has_value) kept.push_back(word);
  }
  return kept;
}

}  // namespace tileflight::jobs
