#pragma once

#include <string>

namespace tileflight::experiment {

/// Version of the program, e.g. "0.1.0".
std::string version();

/// Commit that the program was built from ("unknown" outside a checkout; "+changes" when files differed from it).
std::string commit();

}  // namespace tileflight::experiment
