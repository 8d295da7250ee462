#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tileflight::app {

/// Returns a one-line message, with a remedy, for a command line that could not be parsed. It names the unknown command
/// or option and the most similarly spelled known one. For other faults it rephrases `fault`, the parser's message.
std::string usage_fault(const CLI::App& app, const std::vector<std::string>& arguments, const std::string& fault);

}  // namespace tileflight::app
