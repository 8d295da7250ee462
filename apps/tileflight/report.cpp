#include "tileflight/experiments/report/report.h"

#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "command.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/experiments/study/study_results.h"

namespace tileflight::app {
namespace {

/// xdg-open reports failure within this time; on some desktops it runs as long as the viewer.
constexpr std::chrono::milliseconds kPatience{3000}, kStep{20};

[[noreturn]] void refuse(const std::string& file, const std::string& why) {
  throw InputError(file, "was written but could not be opened: " + why + "; open it in a browser by hand");
}

pid_t spawned(const std::string& file) {
  std::string program = "xdg-open", argument = file;
  char* const arguments[] = {program.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int fault = posix_spawnp(&child, program.c_str(), nullptr, nullptr, arguments, environ);
  if (fault == ENOENT) refuse(file, "xdg-open is not installed (package xdg-utils)");
  if (fault != 0) refuse(file, "xdg-open could not be started");
  return child;
}

/// Opens a file with the desktop's default program (xdg-open) without waiting for it. Throws InputError without a
/// desktop.
void open_in_viewer(const std::filesystem::path& file) {
  const pid_t child = spawned(file.string());
  for (auto waited = std::chrono::milliseconds(0); waited < kPatience; waited += kStep) {
    int status = 0;
    if (waitpid(child, &status, WNOHANG) == child) {
      if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
      refuse(file.string(), "xdg-open found no browser");
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
