#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::workflow {

/// Runs a program in `folder` and waits for it. Its input is empty; its output goes to `log`, or, without one, to this
/// process's standard error. If this process ends first, in any way (also by SIGKILL), the program and all of
/// its process group are ended: interrupted as by Ctrl-C, asked to terminate 3 s later, killed after 15 s. Until then
/// files that this process has locked (flock) stay locked. Returns the exit status, 128 + signal, or 127 if there is no
/// such program. Throws InputError if no process can be started.
int run_guarded(const std::vector<std::string>& words, const std::filesystem::path& folder,
                const std::filesystem::path& log);

}  // namespace tileflight::workflow
