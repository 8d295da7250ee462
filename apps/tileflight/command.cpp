#include "command.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"

namespace tileflight::app {
namespace {

#ifndef TILEFLIGHT_LIVE
/// Adds a command that this program was built without: any use of it fails with one line that says so.
void add_absent_command(CLI::App& app, CommonOptions& common, Selection& selection, const std::string& name) {
  CLI::App* command = app.add_subcommand(name, "absent: this program was built without the simulator");
  command->allow_extras();
  add_common_options(*command, common);
  command->callback([name, &selection] {
    selection.run = [name](const CommonOptions&, const Progress&) -> Output {
      throw InputError(name, "this program was built without the simulator and its servers (TILEFLIGHT_LIVE=OFF)");
    };
  });
}
#endif

}  // namespace

// One function per command, each in the file of its name: adds the subcommand and binds it to the selection.
using AddCommand = void(CLI::App& app, CommonOptions& common, Selection& selection);
AddCommand add_scene, add_tile, add_inspect, add_extract, add_coverage, add_preview, add_render, add_lens, add_ingest,
    add_export, add_odometry, add_systems, add_align, add_evaluate, add_compare, add_localize, add_new, add_run,
    add_study, add_report, add_play, add_serve, add_completion;

void add_commands(CLI::App& app, CommonOptions& common, Selection& selection) {
  for (AddCommand* add : {add_scene,   add_tile,     add_inspect, add_extract,  add_coverage, add_preview, add_render,
                          add_lens,    add_ingest,   add_export,  add_odometry, add_systems,  add_align,   add_evaluate,
                          add_compare, add_localize, add_new,     add_run,      add_study,    add_report})
    add(app, common, selection);
#ifdef TILEFLIGHT_LIVE
  add_play(app, common, selection);
  add_serve(app, common, selection);
#else
  add_absent_command(app, common, selection, "play");
  add_absent_command(app, common, selection, "serve");
#endif
  add_completion(app, common, selection);
}

void add_common_options(CLI::App& command, CommonOptions& common) {
  command.add_flag("--json", common.json, "print one JSON object and nothing else on stdout");
  command.add_flag("--quiet", common.quiet, "print nothing but errors");
  command.add_flag("--force", common.force, "replace existing output");
  command.add_option("--threads", common.threads, "threads to use (default: one for each core)")
      ->check(CLI::Range(1, 1024));
}

std::string version_text() {
  return "tileflight " + base::version() + "\ncommit " + base::commit() +
         "\nbuilt by " TILEFLIGHT_COMPILER ", " TILEFLIGHT_BUILD_TYPE "\nwith " TILEFLIGHT_BUILT_WITH;
}

}  // namespace tileflight::app
