#pragma once

#include <string>

namespace tileflight::app {

/// Text of `tileflight --version`: a first line of name and version, then commit, compiler and build type, and the
/// libraries that decide speed and abilities.
std::string version_text();

}  // namespace tileflight::app
