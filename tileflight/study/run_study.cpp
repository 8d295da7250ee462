#include "tileflight/study/run_study.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <system_error>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/make_folder.h"
#include "tileflight/experiment/folder_lock.h"
#include "tileflight/study/study_results.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Leaves an equal file as it is: its time tells what must be done again.
void write_if_changed(const fs::path& file, const std::string& text) {
  std::error_code missing;
  if (fs::file_size(file, missing) == text.size() && !missing && base::read_text(file) == text) return;
  base::write_file(file, text);
}

/// A Python string.
std::string quoted(const std::string& text) { return json(text).dump(); }

std::string list_text(const std::vector<std::string>& files) {
  std::string text;
  for (const std::string& file : files) text += (text.empty() ? "\n        " : ",\n        ") + quoted(file);
  return text;
}

/// A rule for each task, with its inputs, outputs and needs.
std::string snakefile(const StudyPlan& plan) {
  std::ostringstream text;
  text << "# Written by `tileflight study`. By hand, or with a cluster's profile, in this folder:\n"
       << "#   snakemake --cores all --rerun-triggers mtime --rerun-incomplete --keep-going\n"
       << "rule all:\n    input:" << list_text(plan.tasks.back().outputs) << "\n";
  for (const StudyTask& task : plan.tasks) {
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

void write_plan(const StudyPlan& plan, const fs::path& folder) {
  base::make_folder(folder / "tasks");
  base::make_folder(folder / "logs");
  base::make_folder(folder / "done");
  write_if_changed(folder / "study.yaml", base::read_text(plan.study.file));
  write_if_changed(folder / "settings.yaml", "# For align and evaluate.\n" + plan.study.settings);
  write_if_changed(folder / "plan.json", describe_plan(plan).dump(2) + "\n");
  for (const StudyTask& task : plan.tasks) write_if_changed(folder / "tasks" / (task.name + ".sh"), task.script);
  write_if_changed(folder / "Snakefile", snakefile(plan));
  write_if_changed(folder / "slurm-status", kSlurmStatus);
  fs::permissions(folder / "slurm-status", fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec,
                  fs::perm_options::add);
}

/// Runs a program in `folder`; its output goes to `log`, or to this process's standard error. It ends with this
/// process. Returns the exit status, 128 + signal, or 127 if there is no such program.
int run_program(const std::vector<std::string>& words, const fs::path& folder, const fs::path& log) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t child = fork();
  if (child < 0) throw InputError(words.front(), std::string("cannot be started: ") + std::strerror(errno));
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    const int output = log.empty() ? dup(STDERR_FILENO) : open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    const int input = open("/dev/null", O_RDONLY);
    if (output < 0 || input < 0 || chdir(folder.c_str()) != 0) _exit(126);
    dup2(input, STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    for (const int signal : {SIGPIPE, SIGXFSZ}) std::signal(signal, SIG_DFL);
    execvp(arguments[0], arguments.data());
    _exit(127);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

bool has_program(const std::string& name) {
  return run_program({"sh", "-c", "command -v " + name}, "/", "/dev/null") == 0;
}

bool is_up_to_date(const StudyTask& task, const fs::path& folder) {
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

InputError failed_task(const StudyTask& task, const fs::path& folder) {
  const fs::path log = folder / "logs" / (task.name + ".txt");
  std::string last;
  std::ifstream lines(log);
  for (std::string line; std::getline(lines, line);) {
    if (!line.empty()) last = line;
  }
  return {"task " + task.name, "failed: " + (last.empty() ? "it printed nothing" : last) + " (" + log.string() +
                                   "); the same command goes on where it stopped"};
}

/// Without Snakemake: the tasks in their order. One that fails does not keep the others from being done.
void run_one_by_one(const StudyPlan& plan, const fs::path& folder, const Progress& progress) {
  const StudyTask* failed = nullptr;
  for (std::size_t i = 0; i < plan.tasks.size(); ++i) {
    const StudyTask& task = plan.tasks[i];
    report_progress(progress, static_cast<std::int64_t>(i), static_cast<std::int64_t>(plan.tasks.size()), task.name);
    if (is_up_to_date(task, folder)) continue;
    const bool has_inputs =
        std::ranges::all_of(task.inputs, [&](const std::string& input) { return fs::exists(folder / input); });
    const bool done = has_inputs && run_program({"sh", "tasks/" + task.name + ".sh"}, folder,
                                                folder / "logs" / (task.name + ".txt")) == 0;
    if (!done && failed == nullptr) failed = &task;
  }
  if (failed != nullptr) throw failed_task(*failed, folder);
}

void run_with_snakemake(const StudyPlan& plan, const PlanOptions& folders, const StudyRunOptions& options,
                        const Progress& progress) {
  std::vector<std::string> words{"snakemake", "--snakefile",        "Snakefile", "--keep-going", "--rerun-triggers",
                                 "mtime",     "--rerun-incomplete", "--nolock",  "--nocolor"};
  if (options.slurm) {
    const std::vector<std::string> cluster{
        "--jobs",
        std::to_string(options.jobs),
        "--cluster",
        "sbatch --parsable --requeue --cpus-per-task={threads} --mem={resources.mem_mb} --time={resources.runtime} "
        "--output=logs/slurm-%j.txt",
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
    words.insert(words.end(), {"--cores", std::to_string(std::max(options.jobs, folders.cores))});
  }
  report_progress(progress, 0, 0,
                  "snakemake is running the tasks (" + (folders.out / "logs/snakemake.txt").string() + ")");
  const int status = run_program(words, folders.out, folders.out / "logs/snakemake.txt");
  if (status == 0) return;
  for (const StudyTask& task : plan.tasks) {
    if (!is_up_to_date(task, folders.out)) throw failed_task(task, folders.out);
  }
  throw InputError("snakemake", "ended with exit status " + std::to_string(status) + " (" +
                                    (folders.out / "logs/snakemake.txt").string() + ")");
}

}  // namespace

json run_study(const StudyPlan& plan, const PlanOptions& folders, const StudyRunOptions& options,
               const Progress& progress) {
  if (fs::exists(folders.out) && !fs::is_empty(folders.out) && !is_study_folder(folders.out))
    throw InputError(folders.out.string(), "holds something else than a study; choose another folder for --out");
  base::make_folder(folders.out);
  const experiment::FolderLock lock(folders.out);
  write_plan(plan, folders.out);
  const bool has_snakemake = options.use_snakemake && has_program("snakemake");
  if (options.slurm && !has_snakemake)
    throw InputError("--slurm", "needs Snakemake 7: install it with `apt-get install snakemake`");
  if (has_snakemake) {
    run_with_snakemake(plan, folders, options, progress);
  } else {
    run_one_by_one(plan, folders.out, progress);
  }
  return write_study_report(folders.out);
}

}  // namespace tileflight::study
