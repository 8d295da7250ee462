#pragma once

#include <filesystem>
#include <map>
#include <string>

namespace tileflight::external_systems {

/// Limits of a process and all that it starts. 0: none.
struct ProcessLimits {
  double seconds = 0.0;    ///< wall-clock time
  double memory_mb = 0.0;  ///< resident memory of all its processes together, 10^6 bytes
};

/// Outcome and resources of a process, with all processes that it started.
struct ProcessReport {
  int exit_status = 0;                              ///< 128 + signal if a signal ended it, as in a shell
  bool out_of_time = false, out_of_memory = false;  ///< stopped at a limit
  bool out_of_log = false;                          ///< stopped because it had printed more than 256 MB
  double seconds = 0.0;                             ///< wall clock
  double cpu_seconds = 0.0;                         ///< user and system time of all processes
  double peak_memory_mb = 0.0;  ///< largest sum of resident memory seen at one moment, and at least the largest of one
                                ///< process (as the kernel counts it)

  bool was_stopped() const { return out_of_time || out_of_memory || out_of_log; }
  bool succeeded() const { return exit_status == 0 && !was_stopped(); }
  /// "exit status 3", "killed by signal 11 (Segmentation fault)", "stopped after 600 s, the time limit", …
  std::string outcome() const;
};

/// Runs a shell command in `folder` with additional environment variables; its output goes to the file `log`, its input
/// is empty. A file of the command ends at 16 GB (SIGXFSZ); of a log of more than 256 MB, the beginning is kept. At a
/// limit, and if this process is asked to end (SIGINT, SIGTERM), all processes of the command are stopped: asked first,
/// killed after 5 s. Processes that leave the command's session are counted and stopped as long as they are still its
/// descendants when it ends. Throws InputError if the process cannot be started. Must not be used by a program that has
/// other child processes.
ProcessReport run_measured(const std::string& command, const std::filesystem::path& folder,
                           const std::map<std::string, std::string>& environment, const std::filesystem::path& log,
                           const ProcessLimits& limits);

}  // namespace tileflight::external_systems
