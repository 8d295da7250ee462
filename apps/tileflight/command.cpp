#include "command.h"

#include "tileflight/core/base/input_error.h"

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

void add_commands(CLI::App& app, CommonOptions& common, Selection& selection) {
  add_scene(app, common, selection);
  add_tile(app, common, selection);
  add_inspect(app, common, selection);
  add_extract(app, common, selection);
  add_coverage(app, common, selection);
  add_preview(app, common, selection);
  add_render(app, common, selection);
  add_ingest(app, common, selection);
  add_export(app, common, selection);
  add_odometry(app, common, selection);
  add_systems(app, common, selection);
  add_align(app, common, selection);
  add_evaluate(app, common, selection);
  add_compare(app, common, selection);
  add_run(app, common, selection);
  add_study(app, common, selection);
  add_report(app, common, selection);
#ifdef TILEFLIGHT_LIVE
  add_play(app, common, selection);
  add_serve(app, common, selection);
#else
  add_absent_command(app, common, selection, "play");
  add_absent_command(app, common, selection, "serve");
#endif
  add_completion(app, common, selection);
}

}  // namespace tileflight::app
