// tileflight COMMAND: parse, call, print, exit code. 0 done, 1 the work failed (one line on stderr), 2 wrong usage.
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "command.h"
#include "terminal_progress.h"
#include "usage_fault.h"

namespace {

using tileflight::app::CommonOptions;
using tileflight::app::Output;
using tileflight::app::Selection;

/// Prints one line, whatever the message contains.
void print_error(std::string message) {
  for (char& c : message) {
    if (c == '\n' || c == '\r') c = ' ';
  }
  std::cerr << "tileflight: " << message << "\n";
}

void print_output(const CommonOptions& common, const Output& output) {
  if (common.json && !output.json.is_null()) {
    std::cout << output.json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) << "\n";
  } else if (!common.json && !common.quiet) {
    std::cout << output.text;
  }
  if (!std::cout.flush()) throw std::runtime_error("cannot write to standard output");
}

using tileflight::app::TerminalProgress;

TerminalProgress::Form progress_form(const CommonOptions& common, const Selection& selection) {
  const TerminalProgress::Form form = TerminalProgress::form_of_stderr();
  const bool is_silent = common.quiet || (selection.is_server && form == TerminalProgress::Form::kLines);
  return is_silent ? TerminalProgress::Form::kSilent : form;
}

tileflight::experiment::StageListener told_to(TerminalProgress& terminal) {
  using What = tileflight::experiment::StageEvent::Kind;
  return [&terminal](const tileflight::experiment::StageEvent& news) {
    if (news.kind == What::kBegins) terminal.begin_stage(news.stage);
    if (news.kind == What::kDone) terminal.end_stage(news.stage, news.seconds);
    if (news.kind == What::kUnchanged) terminal.stage_is_unchanged(news.stage);
  };
}

int run_selected(CommonOptions& common, const Selection& selection) {
  const std::size_t threads =
      common.threads > 0 ? static_cast<std::size_t>(common.threads) : std::max(1U, std::thread::hardware_concurrency());
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
  TerminalProgress terminal(progress_form(common, selection), stderr);
  common.stages = told_to(terminal);
  const tileflight::Progress progress = [&terminal](std::int64_t done, std::int64_t total, std::string_view what) {
    terminal.update(done, total, what);
  };
  try {
    const Output output = selection.run(common, progress);
    terminal.clear();
    print_output(common, output);  // may fail, and then only the error is printed
    terminal.finish();
    return 0;
  } catch (const std::bad_alloc&) {
    terminal.clear();
    print_error("out of memory; choose a smaller region, a larger voxel or a smaller image");
  } catch (const std::exception& fault) {
    terminal.clear();
    print_error(fault.what());
  }
  return 1;
}

/// Exit code 0 for --help and --version.
int end_of_parsing(const CLI::App& app, const CLI::ParseError& fault, const std::vector<std::string>& arguments) {
  if (fault.get_exit_code() == static_cast<int>(CLI::ExitCodes::Success)) return app.exit(fault);
  print_error(tileflight::app::usage_fault(app, arguments, fault.what()));
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  // A closed pipe or a file above the size limit is an error of that write and must not terminate the process.
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  CLI::App app{"Render drone flights over 3D Tiles of a real place, and measure how accurate a SLAM map of it is."};
  app.name("tileflight");
  app.require_subcommand(1);
  app.set_version_flag("--version", tileflight::app::version_text());

  CommonOptions common;
  common.arguments.assign(argv + 1, argv + argc);
  Selection selection;
  tileflight::app::add_commands(app, common, selection);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& fault) {
    return end_of_parsing(app, fault, {argv + 1, argv + argc});
  }
  return run_selected(common, selection);
}
