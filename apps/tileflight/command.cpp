#include "command.h"

namespace tileflight::app {

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
  add_play(app, common, selection);
  add_serve(app, common, selection);
  add_completion(app, common, selection);
}

}  // namespace tileflight::app
