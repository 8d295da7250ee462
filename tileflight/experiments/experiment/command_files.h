#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// The files named by the words of a shell command, each once, in order: by their path, relative to `folder` (the
/// command's working directory), or as programs in PATH. Also after a '=', as in `--config=slam.yaml`. Files named
/// inside those files are not searched for.
std::vector<std::filesystem::path> find_command_files(const std::string& command, const std::filesystem::path& folder);

}  // namespace tileflight::experiment
