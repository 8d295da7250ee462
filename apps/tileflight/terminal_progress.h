#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::app {

/// What a command says on stderr while it works.
///
/// On a terminal: one line, rewritten in place, of the stage, what it is at, the share that is done and the time left;
/// stages of a run leave a line each. Elsewhere (a file, a log): a line for each stage that is done, with the time that
/// it took. A stage is one of a run's (begin_stage), else one kind of work: what update() says of it before a ": ".
/// A failure within the first seconds is told by its own line alone.
class TerminalProgress {
 public:
  enum class Form { kSilent, kTerminal, kLines };
  /// What stderr is.
  static Form form_of_stderr();

  TerminalProgress(Form form, std::FILE* stream);
  ~TerminalProgress();
  TerminalProgress(const TerminalProgress&) = delete;
  TerminalProgress& operator=(const TerminalProgress&) = delete;

  void update(std::int64_t done, std::int64_t total, std::string_view what);
  void begin_stage(const std::string& name);
  void end_stage(const std::string& name, double seconds);
  void stage_is_unchanged(const std::string& name);

  /// The work is done: says what is still to be said, and leaves no line half written.
  void finish();
  /// The work has failed: leaves no line half written.
  void clear();

 private:
  using Clock = std::chrono::steady_clock;
  /// One kind of work, with the time that it took and that lines were written of.
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
  std::string stage_;  ///< of a run, that is being done; empty: none
  std::vector<Step> steps_;
  std::size_t step_ = 0;  ///< that is being done, where there are any
  Clock::time_point step_begin_{}, shown_at_{};
  std::vector<std::string> held_back_;  ///< lines of the first seconds
  bool is_shown_ = false;               ///< a line that is not ended
};

}  // namespace tileflight::app
