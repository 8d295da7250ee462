#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace tileflight::experiment {

/// The files that the words of a shell command name, each once, in their order: by their whole path, relative to
/// `folder` (where the command runs), or as programs of PATH. Also behind a '=', as in `--config=slam.yaml`. Files that
/// those files name in turn are not looked for.
std::vector<std::filesystem::path> command_files(const std::string& command, const std::filesystem::path& folder);

}  // namespace tileflight::experiment
