#include "tileflight/core/jobs/run_tasks.h"

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/process.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

/// A Python string.
std::string quoted(const std::string& text) { return nlohmann::json(text).dump(); }

std::string list_text(const std::vector<std::string>& files) {
  std::string text;
  for (const std::string& file : files) text += (text.empty() ? "\n        " : ",\n        ") + quoted(file);
  return text;
}

/// A rule for each task, with its inputs, outputs and needs.
std::string snakefile(const std::vector<Task>& tasks, const std::string& made_by) {
  std::ostringstream text;
  text << "# Written by `" << made_by << "`. By hand, or with a cluster's profile, in this folder:\n"
       << "#   snakemake --cores all --rerun-triggers mtime --rerun-incomplete --keep-going\n"
       << "rule all:\n    input:" << list_text(tasks.back().outputs) << "\n";
  for (const Task& task : tasks) {
    std::string rule = task.name;
    std::ranges::replace_if(
        rule, [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
    text << "\nrule " << rule << ":\n    input:" << list_text(task.inputs) << "\n    output:" << list_text(task.outputs)
         << "\n    threads: " << task.threads << "\n    resources: mem_mb=" << task.memory_mb
         << ", runtime=" << task.minutes << "\n    log: " << quoted("logs/" + task.name + ".txt")
         << "\n    shell: " << quoted("sh tasks/" + task.name + ".sh > {log} 2>&1") << "\n";
  }
  return text.str();
}

/// Tells Snakemake the state of a job; only scontrol is asked, so that no accounting database is needed.
constexpr const char* kSlurmStatus = R"(#!/bin/sh
state=$(scontrol show job "$1" --oneliner 2>/dev/null | sed -n 's/.*JobState=\([A-Z_]*\).*/\1/p')
case $state in
  COMPLETED) echo success ;;
  PENDING|CONFIGURING|RUNNING|COMPLETING|SUSPENDED|REQUEUED|REQUEUE_HOLD|RESIZING) echo running ;;
  "") # Slurm forgets ended jobs after a while, and a controller that restarts does not answer.
    if scontrol ping >/dev/null 2>&1; then echo failed; else echo running; fi ;;
  *) echo failed ;;
esac
)";

bool has_program(const std::string& name) { return run_guarded({shell("command -v " + name), "/", "/dev/null"}) == 0; }

bool is_up_to_date(const Task& task, const fs::path& folder) {
  fs::file_time_type oldest = fs::file_time_type::max();
  for (const std::string& output : task.outputs) {
    std::error_code missing;
    oldest = std::min(oldest, fs::last_write_time(folder / output, missing));
    if (missing) return false;
  }
  return std::ranges::all_of(task.inputs, [&](const std::string& input) {
    std::error_code missing;
    const auto time = fs::last_write_time(folder / input, missing);
    return !missing && time <= oldest;
  });
}

InputError failed_task(const Task& task, const fs::path& folder) {
  const fs::path log = folder / "logs" / (task.name + ".txt");
  const std::string last = last_line(log);
  return {"task " + task.name, "failed: " + (last.empty() ? "it printed nothing" : last) + " (" + log.string() +
                                   "); the same command goes on where it stopped"};
}

/// Without Snakemake: the tasks in their order. One that fails does not keep the others from being done.
void run_one_by_one(const std::vector<Task>& tasks, const fs::path& folder, const Progress& progress) {
  const Task* failed = nullptr;
  for (std::size_t i = 0; i < tasks.size(); ++i) {
    const Task& task = tasks[i];
    report_progress(progress, static_cast<std::int64_t>(i), static_cast<std::int64_t>(tasks.size()), task.name);
    if (is_up_to_date(task, folder)) continue;
    const bool has_inputs =
        std::ranges::all_of(task.inputs, [&](const std::string& input) { return fs::exists(folder / input); });
    const bool done =
        has_inputs &&
        run_guarded({{"sh", "tasks/" + task.name + ".sh"}, folder, folder / "logs" / (task.name + ".txt")}) == 0;
    if (!done && failed == nullptr) failed = &task;
  }
  if (failed != nullptr) throw failed_task(*failed, folder);
}

void run_with_snakemake(const std::vector<Task>& tasks, const fs::path& folder, const TaskOptions& options,
                        const Progress& progress) {
  std::vector<std::string> words{"snakemake", "--snakefile",        "Snakefile", "--keep-going", "--rerun-triggers",
                                 "mtime",     "--rerun-incomplete", "--nolock",  "--nocolor"};
  if (options.slurm) {
    const std::vector<std::string> cluster{
        "--jobs",
        std::to_string(options.jobs),
        "--cluster",
        ("sbatch --parsable --requeue --cpus-per-task={threads} --mem={resources.mem_mb} --time={resources.runtime} "
         "--output=logs/slurm-%j.txt"),
        "--cluster-status",
        "./slurm-status",
        "--cluster-cancel",
        "scancel",
        "--latency-wait",
        "60",
        "--max-status-checks-per-second",
        "1"};
    words.insert(words.end(), cluster.begin(), cluster.end());
  } else {
    words.insert(words.end(), {"--cores", std::to_string(std::max(options.jobs, options.cores))});
  }
  report_progress(progress, 0, 0, "snakemake is running the tasks (" + (folder / "logs/snakemake.txt").string() + ")");
  const int status = run_guarded({words, folder, folder / "logs/snakemake.txt"});
  if (status == 0) return;
  for (const Task& task : tasks) {
    if (!is_up_to_date(task, folder)) throw failed_task(task, folder);
  }
  throw InputError("snakemake", "ended with exit status " + std::to_string(status) + " (" +
                                    (folder / "logs/snakemake.txt").string() + ")");
}

}  // namespace

void write_if_changed(const fs::path& file, const std::string& text) {
  std::error_code missing;
  if (fs::file_size(file, missing) == text.size() && !missing && base::read_raw(file) == text) return;
  base::write_file(file, text);
}

std::string marker_of(const std::string& task) { return "done/" + task; }

void write_tasks(const std::vector<Task>& tasks, const fs::path& folder, const std::string& made_by) {
  base::make_folder(folder / "tasks");
  base::make_folder(folder / "logs");
  base::make_folder(folder / "done");
  for (const Task& task : tasks) write_if_changed(folder / "tasks" / (task.name + ".sh"), task.script);
  write_if_changed(folder / "Snakefile", snakefile(tasks, made_by));
  write_if_changed(folder / "slurm-status", kSlurmStatus);
  fs::permissions(folder / "slurm-status", fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec,
                  fs::perm_options::add);
}

void run_tasks(const std::vector<Task>& tasks, const fs::path& folder, const TaskOptions& options,
               const Progress& progress) {
  const bool has_snakemake = options.use_snakemake && has_program("snakemake");
  if (options.slurm && !has_snakemake)
    throw InputError("--slurm", "needs Snakemake 7: install it with `apt-get install snakemake`");
  if (has_snakemake) {
    run_with_snakemake(tasks, folder, options, progress);
  } else {
    run_one_by_one(tasks, folder, progress);
  }
}

}  // namespace tileflight::jobs
