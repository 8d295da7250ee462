#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::app {

/// Reports a command's progress on stderr.
///
/// On a terminal: one line, rewritten in place, with the stage, the current item, the share done and the time left;
/// each finished stage of a run leaves a line. Otherwise (a file, a log): a line for each finished stage, with its
/// duration. A stage is one of a run (begin_stage), else one kind of work: the text before ": " in update(). A failure
/// within the first seconds prints only the error.
class TerminalProgress {
 public:
  enum class Form { kSilent, kTerminal, kLines };
  /// Returns the form for the output that stderr is connected to.
  static Form form_of_stderr();

  TerminalProgress(Form form, std::FILE* stream);
  ~TerminalProgress();
  TerminalProgress(const TerminalProgress&) = delete;
  TerminalProgress& operator=(const TerminalProgress&) = delete;

  void update(std::int64_t done, std::int64_t total, std::string_view what);
  void begin_stage(const std::string& name);
  void end_stage(const std::string& name, double seconds);
  void stage_is_unchanged(const std::string& name);

  /// Ends a successful command: prints pending lines and completes the current one.
  void finish();
  /// Ends a failed command: completes the current line.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  /// One kind of work, its duration, and how much of it was printed.
  struct Step {
    std::string name;
    double seconds = 0.0, told_seconds = 0.0;
    bool is_told = false;
  };

  void enter_step(std::string_view what);
  void leave_step();
  void tell_steps();
  void tell(const std::string& line);
  void show(std::int64_t done, std::int64_t total, std::string_view what);
  void erase_line();

  std::mutex mutex_;
  Form form_;
  std::FILE* stream_;
  Clock::time_point begin_ = Clock::now();
  std::string stage_;  ///< current stage of a run; empty: none
  std::vector<Step> steps_;
  std::size_t step_ = 0;  ///< current step, if there are any
  Clock::time_point step_begin_{}, shown_at_{};
  std::vector<std::string> held_back_;  ///< lines withheld during the first seconds
  bool is_shown_ = false;               ///< a line without its end is displayed
};

}  // namespace tileflight::app
