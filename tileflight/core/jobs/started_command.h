#pragma once

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

namespace tileflight::jobs {

/// A shell command that runs in the background until this object is destroyed, as do the processes that it starts.
/// Its input is empty.
class StartedCommand {
 public:
  /// Runs it in `folder`; what it prints goes to the file `log`. Throws InputError if it cannot be started.
  StartedCommand(const std::string& command, const std::filesystem::path& folder, std::filesystem::path log);
  /// Stops its process group: asked first, killed after 3 s.
  ~StartedCommand();
  StartedCommand(const StartedCommand&) = delete;
  StartedCommand& operator=(const StartedCommand&) = delete;

  /// "exit status 3", "killed by signal 11", once the command has ended; processes that it started may still run.
  std::optional<std::string> end();
  /// The last line that it has printed, at most 200 characters; empty if there is none.
  std::string last_line() const;

 private:
  bool wait_until_gone(std::chrono::milliseconds patience);

  pid_t process_ = -1;
  std::filesystem::path log_;
  std::optional<int> status_;  ///< of waitpid
};

}  // namespace tileflight::jobs
