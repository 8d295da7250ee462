#pragma once

#include <filesystem>
#include <string>

namespace tileflight::base {

/// Returns the file of the program `tileflight`, for scripts and tasks that call it: the running program's own file,
/// unless set_program_path() named another. Empty if the system does not tell.
std::filesystem::path program_path();

/// Sets the file of `tileflight` in a program that contains the library (the Python module). Must not be called while
/// other threads use the library.
void set_program_path(std::filesystem::path program);

/// Returns the folder of files that the program needs: `share/tileflight` beside the folder of the program, as in an
/// installation, an unpacked archive or the Python package. It need not exist. Empty if program_path() is.
std::filesystem::path data_folder();

/// Returns the version of the program, e.g. "0.1.0".
std::string version();

/// Returns the commit that the program was built from ("unknown" outside a checkout; "+changes" when files differed
/// from it).
std::string commit();

/// Returns the SHA-256 of the program's own file (base::program_path()).
std::string program_fingerprint();

}  // namespace tileflight::base
