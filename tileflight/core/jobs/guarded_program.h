#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::jobs {

/// After how many seconds a program that is interrupted is asked to terminate, and killed.
struct Patience {
  int until_terminated_s = 3;
  int until_killed_s = 15;
};

/// Runs a program in `folder` and waits for it. Its input is empty; its output goes to `log`, or, without one, to this
/// process's standard error. If this process ends first, in any way (also by SIGKILL), the program and all of
/// its process group are ended: interrupted as by Ctrl-C, then with `patience`. Until then files that this process has
/// locked (flock) stay locked. Returns the exit status, 128 + signal, or 127 if there is no
/// such program. Throws InputError if no process can be started.
int run_guarded(const std::vector<std::string>& words, const std::filesystem::path& folder,
                const std::filesystem::path& log, const Patience& patience = {});

}  // namespace tileflight::jobs
