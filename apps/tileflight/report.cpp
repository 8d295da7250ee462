#include "tileflight/experiments/report/report.h"

#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <thread>

#include "command.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/jobs/process.h"
#include "tileflight/experiments/study/study_results.h"

namespace tileflight::app {
namespace {

/// xdg-open reports failure within this time; on some desktops it runs as long as the viewer.
constexpr std::chrono::milliseconds kPatience{3000}, kStep{20};

/// Opens a file with the desktop's default program (xdg-open) without waiting for it. Throws InputError without a
/// desktop.
void open_in_viewer(const std::filesystem::path& file) {
  jobs::Process viewer({.words = {"xdg-open", file.string()}});
  viewer.leave_running();
  for (auto waited = std::chrono::milliseconds(0); waited < kPatience; waited += kStep) {
    if (const std::optional<int> status = viewer.exit_status()) {
      if (*status == 0) return;
      throw InputError(file.string(), std::string("was written but could not be opened: ") +
                                          (*status == 127 ? "xdg-open is not installed (package xdg-utils)"
                                                          : "xdg-open found no browser") +
                                          "; open it in a browser by hand");
    }
    std::this_thread::sleep_for(kStep);
  }
}

}  // namespace

void add_report(CLI::App& app, CommonOptions& common, Selection& selection) {
  struct Options {
    std::string folder;
    bool open = false;
  };
  auto options = std::make_shared<Options>();
  CLI::App* command =
      app.add_subcommand("report", "rebuild report.html and figures from the results of a run, or of trajectories");
  command->footer("Example:\n  tileflight report out/stadium --open");
  command->add_option("DIR", options->folder, "folder of a run, of a study, or of the metrics.json of trajectories")
      ->required();
  command->add_flag("--open", options->open, "open the report in the desktop's browser");
  add_common_options(*command, common);
  command->callback([options, &selection] {
    selection.run = [options](const CommonOptions&, const Progress&) -> Output {
      const bool is_study = study::is_study_folder(options->folder);
      if (is_study) {
        study::write_study_report(options->folder);
      } else if (report::holds_trajectories_alone(options->folder)) {
        report::write_trajectory_report(options->folder);
      } else {
        report::write_report(options->folder);
      }
      const std::filesystem::path file =
          (std::filesystem::absolute(options->folder) / (is_study ? "study.html" : "report.html")).lexically_normal();
      if (options->open) open_in_viewer(file);
      return {{{"report", file.string()}}, "report: " + file.string() + "\n"};
    };
  });
}

}  // namespace tileflight::app
