#pragma once

#include <filesystem>

namespace tileflight::experiment {

/// Fills an empty folder with hard links to the files of another (copies where the file system has none): writers
/// replace files, so neither folder changes the other. Throws InputError.
void link_files(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace tileflight::experiment
