#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tileflight::app {

/// What is wrong with a command line that could not be parsed, and what to do, on one line: a command or option that
/// there is not (with the one that is spelled most like it), else `fault`, which the parser says.
std::string usage_fault(const CLI::App& app, const std::vector<std::string>& arguments, const std::string& fault);

}  // namespace tileflight::app
