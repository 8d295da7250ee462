#pragma once

#include <filesystem>

namespace tileflight::base {

/// The program `tileflight`, for scripts and tasks that call it: the running program's own file, unless
/// set_program_path() named another. Empty if the system does not tell.
std::filesystem::path program_path();

/// For programs that contain the library (the Python module): the file of `tileflight` that was built with it. Not to
/// be called while other threads use the library.
void set_program_path(std::filesystem::path program);

}  // namespace tileflight::base
