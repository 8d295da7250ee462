#pragma once

#include <CLI/CLI.hpp>
#include <string>

namespace tileflight::app {

/// Completion script for bash (a function registered with `complete -F`, as the Bash manual's section Programmable
/// Completion describes it), made from the application's own commands: their names, options, the words that an option
/// may have, files where a value may be one, nothing where it is a number.
std::string bash_completion(const CLI::App& app);

/// The same for zsh: a function of _arguments and _describe with each option's help (zsh manual, section Completion
/// System). To be written to a folder of $fpath as _tileflight.
std::string zsh_completion(const CLI::App& app);

}  // namespace tileflight::app
