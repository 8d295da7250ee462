#include "terminal_progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>

#include "number_text.h"

namespace tileflight::app {
namespace {

constexpr std::chrono::milliseconds kBetweenLines{100};
constexpr std::chrono::seconds kHeldBack{2};
/// Below these, the remaining time of a step cannot be estimated.
constexpr double kLeastSeconds = 2.0, kLeastShare = 0.01;

double seconds_between(std::chrono::steady_clock::time_point from, std::chrono::steady_clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

/// " 45 %, 1 min 20 s left"
std::string share_text(std::int64_t done, std::int64_t total, double seconds) {
  if (total <= 0) return done > 0 ? " (" + std::to_string(done) + ")" : "";
  const double share = std::clamp(static_cast<double>(done) / static_cast<double>(total), 0.0, 1.0);
  std::string text = " " + std::to_string(static_cast<int>(100.0 * share)) + " %";
  if (share > kLeastShare && share < 1.0 && seconds > kLeastSeconds)
    text += ", " + duration_text(seconds * (1.0 - share) / share) + " left";
  return text;
}

/// Columns of the terminal, or a default if it does not report them.
std::size_t columns_of(std::FILE* stream) {
  winsize size{};
  constexpr std::size_t kUsual = 80;
  return ::ioctl(::fileno(stream), TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : kUsual;
}

}  // namespace

TerminalProgress::Form TerminalProgress::form_of_stderr() {
  return ::isatty(STDERR_FILENO) == 1 ? Form::kTerminal : Form::kLines;
}

TerminalProgress::TerminalProgress(Form form, std::FILE* stream) : form_(form), stream_(stream) {}

TerminalProgress::~TerminalProgress() { clear(); }

void TerminalProgress::update(std::int64_t done, std::int64_t total, std::string_view what) {
  if (form_ == Form::kSilent) return;
  const std::lock_guard lock(mutex_);
  const bool is_new = steps_.empty() || steps_[step_].name != what.substr(0, what.find(": "));
  if (is_new) enter_step(what);
  if (form_ == Form::kTerminal && (is_new || Clock::now() - shown_at_ >= kBetweenLines)) show(done, total, what);
}

void TerminalProgress::begin_stage(const std::string& name) {
  const std::lock_guard lock(mutex_);
  stage_ = name;
  steps_.clear();
  if (form_ == Form::kTerminal) show(0, 0, "");
}

void TerminalProgress::end_stage(const std::string& name, double seconds) {
  const std::lock_guard lock(mutex_);
  tell(name + ": " + duration_text(seconds));
  stage_.clear();
  steps_.clear();
}

void TerminalProgress::stage_is_unchanged(const std::string& name) {
  const std::lock_guard lock(mutex_);
  tell(name + ": unchanged, skipped");
}

void TerminalProgress::finish() {
  const std::lock_guard lock(mutex_);
  leave_step();
  tell_steps();
  for (const std::string& line : held_back_) std::fprintf(stream_, "%s\n", line.c_str());
  held_back_.clear();
  erase_line();
}

void TerminalProgress::clear() {
  const std::lock_guard lock(mutex_);
  erase_line();
}

void TerminalProgress::enter_step(std::string_view what) {
  leave_step();
  const std::string name(what.substr(0, what.find(": ")));
  const auto known = std::find_if(steps_.begin(), steps_.end(), [&](const Step& step) { return step.name == name; });
  if (known == steps_.end()) tell_steps();  // alternating steps are reported at the end
  step_ = static_cast<std::size_t>(known - steps_.begin());
  if (known == steps_.end()) steps_.push_back({.name = name});
  step_begin_ = Clock::now();
}

void TerminalProgress::leave_step() {
  if (steps_.empty()) return;
  const auto now = Clock::now();
  steps_[step_].seconds += seconds_between(step_begin_, now);
  step_begin_ = now;
}

/// Prints the steps of a command without stages; a stage prints its own line.
void TerminalProgress::tell_steps() {
  if (!stage_.empty() || form_ != Form::kLines) return;
  for (Step& step : steps_) {
    const double seconds = step.seconds - step.told_seconds;
    constexpr double kNothing = 0.05;
    if (step.is_told && seconds < kNothing) continue;
    tell(step.name + (step.is_told ? ", continued: " : ": ") + duration_text(seconds));
    step.told_seconds = step.seconds;
    step.is_told = true;
  }
}

void TerminalProgress::tell(const std::string& line) {
  if (form_ == Form::kSilent) return;
  if (form_ == Form::kLines && Clock::now() - begin_ < kHeldBack) {
    held_back_.push_back(line);
    return;
  }
  erase_line();
  for (const std::string& earlier : held_back_) std::fprintf(stream_, "%s\n", earlier.c_str());
  held_back_.clear();
  std::fprintf(stream_, "%s\n", line.c_str());
  std::fflush(stream_);
}

void TerminalProgress::show(std::int64_t done, std::int64_t total, std::string_view what) {
  shown_at_ = Clock::now();
  std::string line = stage_ + (stage_.empty() || what.empty() ? "" : ": ") + std::string(what);
  line += share_text(done, total, seconds_between(step_begin_, shown_at_));
  line.resize(std::min(line.size(), columns_of(stream_) - 1));
  std::fprintf(stream_, "\r\033[K%s", line.c_str());
  std::fflush(stream_);
  is_shown_ = true;
}

void TerminalProgress::erase_line() {
  if (is_shown_) std::fprintf(stream_, "\r\033[K");
  std::fflush(stream_);
  is_shown_ = false;
}

}  // namespace tileflight::app
