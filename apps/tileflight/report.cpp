#include "tileflight/report/report.h"

#include "command.h"

namespace tileflight::app {

void add_report(CLI::App& app, CommonOptions& common, Selection& selection) {
  auto folder = std::make_shared<std::string>();
  CLI::App* command = app.add_subcommand("report", "report.html again from the results of a run");
  command->footer("Example:\n  tileflight report out/stadium");
  command->add_option("DIR", *folder, "folder of a run")->required();
  add_common_options(*command, common);
  command->callback([folder, &selection] {
    selection.run = [folder](const CommonOptions&, const Progress&) -> Output {
      report::write_report(*folder);
      const std::string file = (std::filesystem::path(*folder) / "report.html").string();
      return {{{"report", file}}, "report: " + file + "\n"};
    };
  });
}

}  // namespace tileflight::app
