#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace tileflight::app {

/// A one-line message for a command line that could not be parsed, with a remedy: an unknown command or option (with
/// the most similarly spelled one), else `fault`, the parser's message.
std::string usage_fault(const CLI::App& app, const std::vector<std::string>& arguments, const std::string& fault);

}  // namespace tileflight::app
