#include "tileflight/core/jobs/guarded_program.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>

#include "tileflight/core/base/input_error.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

[[noreturn]] void execute(char* const* arguments, const fs::path& folder, const fs::path& log) {
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  const int output = log.empty() ? dup(STDERR_FILENO) : open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
  const int input = open("/dev/null", O_RDONLY);
  if (output < 0 || input < 0 || chdir(folder.c_str()) != 0) _exit(126);
  dup2(input, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
  execvp(arguments[0], arguments);
  _exit(127);
}

int exit_status_of(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

/// Ends the process group and waits until nothing of it is left. Its leader is this process, which blocks the signals.
[[noreturn]] void end_group(const Patience& patience) {
  kill(0, SIGINT);
  const timespec pause{.tv_sec = 0, .tv_nsec = 50'000'000};
  const timespec begun = [] {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return now;
  }();
  bool has_asked = false;
  while (waitpid(-1, nullptr, WNOHANG) >= 0 || errno == EINTR) {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    const auto passed_s = now.tv_sec - begun.tv_sec;
    if (passed_s >= patience.until_killed_s) kill(0, SIGKILL);
    if (passed_s >= patience.until_terminated_s && !has_asked) {
      kill(0, SIGTERM);
      has_asked = true;
    }
    nanosleep(&pause, nullptr);
  }
  _exit(128 + SIGINT);
}

/// Leads a process group in which it runs the program, and ends the group when `parent` ends. It never returns, and
/// calls only what may be called after a fork in a process of several threads.
[[noreturn]] void watch(pid_t parent, char* const* arguments, const fs::path& folder, const fs::path& log,
                        const Patience& patience) {
  setpgid(0, 0);
  sigset_t signals;
  sigemptyset(&signals);
  for (const int signal : {SIGCHLD, SIGINT, SIGTERM, SIGHUP}) sigaddset(&signals, signal);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  prctl(PR_SET_CHILD_SUBREAPER, 1);  // what outlives its parent in the group is waited for as well
  if (getppid() != parent) _exit(128 + SIGTERM);
  const pid_t program = fork();
  if (program < 0) _exit(126);
  if (program == 0) execute(arguments, folder, log);
  for (;;) {
    int signal = 0;
    if (sigwait(&signals, &signal) != 0) continue;
    if (signal != SIGCHLD) end_group(patience);
    int status = 0;
    for (pid_t ended = 0; (ended = waitpid(-1, &status, WNOHANG)) > 0;) {
      if (ended == program) _exit(exit_status_of(status));
    }
  }
}

}  // namespace

int run_guarded(const std::vector<std::string>& words, const fs::path& folder, const fs::path& log,
                const Patience& patience) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t parent = getpid(), watcher = fork();
  if (watcher < 0) throw InputError(words.front(), std::string("cannot be started: ") + std::strerror(errno));
  if (watcher == 0) watch(parent, arguments.data(), folder, log, patience);
  int status = 0;
  while (waitpid(watcher, &status, 0) < 0 && errno == EINTR) {
  }
  return exit_status_of(status);
}

}  // namespace tileflight::jobs
