#pragma once

#include <sys/types.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::jobs {

/// A program to start. Its standard input is empty.
struct Command {
  std::vector<std::string> words;                    ///< the program, found through PATH, and its arguments
  std::filesystem::path folder{};                    ///< working directory; empty: that of this process
  std::filesystem::path log{};                       ///< receives what it prints; empty: standard error of this process
  std::map<std::string, std::string> environment{};  ///< variables added to those of this process
  mode_t log_permissions = 0666;                     ///< permissions of a new log, before the umask
};

/// Returns the words of a Command that runs a line of the shell.
std::vector<std::string> shell(const std::string& line);

/// Describes an exit status: "exit status 3", or "killed by signal 11 (Segmentation fault)" for 128 + 11.
std::string describe_exit(int exit_status);

/// Returns the last line of a log that holds more than blanks, at most 1000 bytes of it, control characters replaced by
/// blanks. Empty if there is none.
std::string last_line(const std::filesystem::path& log);

/// A program that runs in the background, with all that it starts, until this object is destroyed. Exit statuses are
/// those of a shell: 128 + signal if a signal ended the program, 127 if there is no such program, 126 if its folder or
/// log cannot be opened.
class Process {
 public:
  /// Throws InputError if no process can be started.
  explicit Process(const Command& command);
  /// Stops the process group: asks it to terminate, and kills it after 3 s.
  ~Process();
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  /// Returns the exit status once the program has ended, also while processes that it started still run.
  std::optional<int> exit_status();
  /// Lets the program run on when this object is destroyed.
  void leave_running() { is_left_ = true; }

 private:
  bool wait_until_gone();

  pid_t process_ = -1;
  std::optional<int> exit_status_;
  bool is_left_ = false;
};

/// Seconds after which a program that is interrupted is asked to terminate, and killed.
struct Patience {
  int until_terminated_s = 3;
  int until_killed_s = 15;
};

/// Runs a program, waits for it and returns its exit status, as Process does. If this process ends first, in any way
/// (also by SIGKILL), the program and all of its process group are ended: interrupted as by Ctrl-C, then with
/// `patience`. Until then files that this process has locked (flock) stay locked. Throws InputError if no process can
/// be started.
int run_guarded(const Command& command, const Patience& patience = {});

/// Limits of a program and all that it starts. 0: none.
struct ProcessLimits {
  double seconds = 0.0;    ///< wall-clock time
  double memory_mb = 0.0;  ///< resident memory of all its processes together, 10^6 bytes
};

/// The end of a program, and the resources that it took with all that it started.
struct ProcessReport {
  int exit_status = 0;                              ///< as Process::exit_status()
  bool out_of_time = false, out_of_memory = false;  ///< stopped at a limit
  bool out_of_log = false;                          ///< stopped because it had printed more than 256 MB
  double seconds = 0.0;                             ///< wall clock
  double cpu_seconds = 0.0;                         ///< user and system time of all processes
  double peak_memory_mb = 0.0;  ///< largest sum of resident memory seen at one moment, and at least the largest of one
                                ///< process (as the kernel counts it)

  bool was_stopped() const { return out_of_time || out_of_memory || out_of_log; }
  bool succeeded() const { return exit_status == 0 && !was_stopped(); }
  /// Describes the end: as describe_exit(), or "stopped after 600 s, the time limit", …
  std::string outcome() const;
};

/// Runs a program to its end, or to a limit, and measures it. A file that it writes ends at 16 GB (SIGXFSZ); of a log
/// of more than 256 MB, the beginning is kept. At a limit, and if this process is asked to end (SIGINT, SIGTERM), all
/// processes of the program are stopped: asked first, killed after 5 s. Processes that leave the program's session are
/// counted and stopped as long as they are still its descendants when it ends. Precondition: this process has no other
/// child processes. Throws InputError if no process can be started, and if this process was asked to end.
ProcessReport run_measured(const Command& command, const ProcessLimits& limits);

}  // namespace tileflight::jobs
