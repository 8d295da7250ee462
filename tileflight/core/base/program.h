#pragma once

#include <filesystem>
#include <string>

namespace tileflight::base {

/// The program `tileflight`, for scripts and tasks that call it: the running program's own file, unless
/// set_program_path() named another. Empty if the system does not tell.
std::filesystem::path program_path();

/// For programs that contain the library (the Python module): the file of `tileflight` that was built with it. Not to
/// be called while other threads use the library.
void set_program_path(std::filesystem::path program);

/// Version of the program, e.g. "0.1.0".
std::string version();

/// Commit that the program was built from ("unknown" outside a checkout; "+changes" when files differed from it).
std::string commit();

/// SHA-256 of the program's own file (base::program_path()).
std::string program_fingerprint();

}  // namespace tileflight::base
