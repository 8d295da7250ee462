#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/experiments/experiment/stage_cache.h"

namespace tileflight::app {

/// Options that every command has.
struct CommonOptions {
  bool json = false;   ///< print one JSON object on stdout, and nothing else
  bool quiet = false;  ///< print nothing on stdout and no progress
  bool force = false;  ///< replace existing output
  int threads = 0;     ///< number of threads; 0: one per core
  /// The words of the command line after the program's name, for commands that call themselves in tasks.
  std::vector<std::string> arguments = {};
  /// Listener for the stages of a run; set by main.
  experiment::StageListener stages = {};
};

/// Output of a command in both of its forms.
struct Output {
  nlohmann::json json;  ///< for programs (--json); null if another process prints
  std::string text;     ///< for people
};

/// The chosen command, bound to its options; filled by the parser.
struct Selection {
  std::function<Output(const CommonOptions&, const Progress&)> run;
  bool is_server = false;  ///< runs until it is stopped: its duration is not reported
};

/// Adds the options that every command has.
void add_common_options(CLI::App& command, CommonOptions& common);

/// Adds all commands to the application. The parser fills `common` and `selection`, which must outlive `app`.
void add_commands(CLI::App& app, CommonOptions& common, Selection& selection);

/// Text of `tileflight --version`: name and version in the first line; then commit, compiler, build type, and the
/// libraries that decide what the program can do and how fast.
std::string version_text();

}  // namespace tileflight::app
