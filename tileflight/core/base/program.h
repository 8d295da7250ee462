#pragma once

#include <string>

namespace tileflight::base {

/// Version of the program, e.g. "0.1.0".
std::string version();

/// Commit that the program was built from ("unknown" outside a checkout; "+changes" when files differed from it).
std::string commit();

/// SHA-256 of the program's own file (base::program_path()).
std::string program_fingerprint();

}  // namespace tileflight::base
