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

/// Options of every command.
struct CommonOptions {
  bool json = false;   ///< one JSON object on stdout, nothing else
  bool quiet = false;  ///< nothing on stdout, no progress
  bool force = false;  ///< replace existing output
  int threads = 0;     ///< 0: one per core
  /// The words of the command line after the program's name, for commands that call themselves in tasks.
  std::vector<std::string> arguments = {};
  /// Listener for the stages of a run; set by main.
  experiment::StageListener stages = {};
};

/// Output of a command: for programs (null: already printed) and for people.
struct Output {
  nlohmann::json json;
  std::string text;
};

/// The chosen command, bound to its options; filled by the parser.
struct Selection {
  std::function<Output(const CommonOptions&, const Progress&)> run;
  bool is_server = false;  ///< runs until it is stopped: its duration is not reported
};

/// Adds the options of every command.
inline void add_common_options(CLI::App& command, CommonOptions& common) {
  command.add_flag("--json", common.json, "print one JSON object and nothing else on stdout");
  command.add_flag("--quiet", common.quiet, "print nothing but errors");
  command.add_flag("--force", common.force, "replace existing output");
  command.add_option("--threads", common.threads, "threads to use (default: one for each core)")
      ->check(CLI::Range(1, 1024));
}

/// Adds all commands; `common` and `selection` are filled by the parser and must outlive the application.
void add_commands(CLI::App& app, CommonOptions& common, Selection& selection);

// One function per command, each in the file of its name: adds the subcommand and binds it to `selection`.
void add_scene(CLI::App& app, CommonOptions& common, Selection& selection);
void add_tile(CLI::App& app, CommonOptions& common, Selection& selection);
void add_inspect(CLI::App& app, CommonOptions& common, Selection& selection);
void add_extract(CLI::App& app, CommonOptions& common, Selection& selection);
void add_coverage(CLI::App& app, CommonOptions& common, Selection& selection);
void add_preview(CLI::App& app, CommonOptions& common, Selection& selection);
void add_render(CLI::App& app, CommonOptions& common, Selection& selection);
void add_ingest(CLI::App& app, CommonOptions& common, Selection& selection);
void add_export(CLI::App& app, CommonOptions& common, Selection& selection);
void add_odometry(CLI::App& app, CommonOptions& common, Selection& selection);
void add_systems(CLI::App& app, CommonOptions& common, Selection& selection);
void add_align(CLI::App& app, CommonOptions& common, Selection& selection);
void add_evaluate(CLI::App& app, CommonOptions& common, Selection& selection);
void add_compare(CLI::App& app, CommonOptions& common, Selection& selection);
void add_run(CLI::App& app, CommonOptions& common, Selection& selection);
void add_study(CLI::App& app, CommonOptions& common, Selection& selection);
void add_report(CLI::App& app, CommonOptions& common, Selection& selection);
void add_play(CLI::App& app, CommonOptions& common, Selection& selection);
void add_serve(CLI::App& app, CommonOptions& common, Selection& selection);
void add_completion(CLI::App& app, CommonOptions& common, Selection& selection);

}  // namespace tileflight::app
