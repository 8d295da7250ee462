#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/run_tasks.h"

namespace tileflight::jobs {

/// A tileflight command divided into tasks: each does a part of the work in a build folder beside the output
/// (build_folder.h), and the last one assembles the output from it.
struct PartedJob {
  /// A call of the command: its words after the program's name.
  struct Call {
    std::string name;  ///< of the task
    std::vector<std::string> words;
  };

  std::filesystem::path output;  ///< file or folder
  std::filesystem::path build_folder;
  std::string command;        ///< "extract"
  std::vector<Call> parts;    ///< may run at the same time
  Call last;                  ///< prints one JSON object, the job's result
  std::string inputs_sha256;  ///< of what the parts are made from: if it changes, they are made again
  int threads = 1;            ///< of each task
  int memory_mb = 4000;
  int minutes = 120;
};

/// Runs the job in the working directory of this process through run_tasks() and returns what its last call printed. A
/// hidden folder DIR/.NAME.tasks holds the workflow until it is done, readable by its owner only, since calls may
/// contain API keys. Finished tasks are skipped. Throws InputError, also if another process runs the job.
nlohmann::json run_parted_job(const PartedJob& job, const TaskOptions& options, const Progress& progress = {});

/// Returns the folder of an output's workflow, which exists while a job is unfinished.
std::filesystem::path tasks_folder_of(const std::filesystem::path& output);

/// Whether the job's last call, of this name, finished but the job was stopped before it returned: run_parted_job()
/// then only returns that result.
bool has_finished_tasks(const std::filesystem::path& output, const std::string& last);

/// Removes options from a command line: `flags` have no value, `valued` have one ("--jobs 2", "--jobs=2").
std::vector<std::string> without_options(const std::vector<std::string>& words, const std::vector<std::string>& flags,
                                         const std::vector<std::string>& valued);

}  // namespace tileflight::jobs
