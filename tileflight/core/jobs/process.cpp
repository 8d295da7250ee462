#include "tileflight/core/jobs/process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <thread>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPoll{20};

int exit_status_of(int status) { return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status); }

// ---- start ----

/// The group of processes that a new one joins, so that all can be signalled together.
enum class Group { kOfParent, kOwn, kOwnSession };

/// A command prepared before fork(): the child of a program with several threads may only make system calls.
class Launch {
 public:
  /// `death_signal`: sent to the program when the thread that started it ends; 0: none.
  Launch(const Command& command, Group group, int death_signal, rlim_t largest_file_bytes = RLIM_INFINITY)
      : command_(command), group_(group), death_signal_(death_signal), largest_file_bytes_(largest_file_bytes) {
    for (const auto& [name, value] : command.environment) variables_.push_back(name + "=" + value);
    for (char** inherited = environ; *inherited != nullptr; ++inherited) {
      const std::string text = *inherited;
      if (!command.environment.contains(text.substr(0, text.find('=')))) variables_.push_back(text);
    }
    const auto pointers = [](const std::vector<std::string>& texts) {
      std::vector<char*> result;
      for (const std::string& text : texts) result.push_back(const_cast<char*>(text.c_str()));
      result.push_back(nullptr);
      return result;
    };
    arguments_ = pointers(command.words);
    environment_ = pointers(variables_);
  }

  [[noreturn]] void execute() const {
    if (group_ == Group::kOwn) setpgid(0, 0);
    if (group_ == Group::kOwnSession) setsid();
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    if (death_signal_ != 0) prctl(PR_SET_PDEATHSIG, death_signal_);
    const int output = command_.log.empty() ? dup(STDERR_FILENO)
                                            : open(command_.log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC,
                                                   command_.log_permissions);
    const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (output < 0 || input < 0) _exit(126);
    if (!command_.folder.empty() && chdir(command_.folder.c_str()) != 0) _exit(126);
    dup2(input, STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
    const rlimit largest{.rlim_cur = largest_file_bytes_, .rlim_max = largest_file_bytes_};
    if (largest_file_bytes_ != RLIM_INFINITY) setrlimit(RLIMIT_FSIZE, &largest);
    execvpe(arguments_.front(), arguments_.data(), environment_.data());
    _exit(127);
  }

  /// Starts `run`, which never returns, in a new process.
  template <class Run>
  pid_t fork_to(const Run& run) const {
    const pid_t child = fork();
    if (child < 0)
      throw InputError("command `" + base::joined(command_.words, " ") + "`",
                       std::string("cannot be started: ") + std::strerror(errno));
    if (child == 0) run();
    return child;
  }

 private:
  const Command& command_;
  Group group_;
  int death_signal_;
  rlim_t largest_file_bytes_;
  std::vector<std::string> variables_;
  std::vector<char*> arguments_, environment_;
};

// ---- a program that ends with this process ----

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
[[noreturn]] void watch(pid_t parent, const Launch& launch, const Patience& patience) {
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
  if (program == 0) launch.execute();
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

// ---- a measured program ----

constexpr std::chrono::seconds kGracePeriod{5};

/// The largest file that a command may write, and the longest log: more is a fault that would fill the disk.
constexpr rlim_t kLargestFileBytes = rlim_t{16} << 30;
constexpr std::uintmax_t kLargestLogBytes = std::uintmax_t{256} << 20, kKeptLogBytes = std::uintmax_t{1} << 20;

std::uintmax_t size_of(const fs::path& file) {
  std::error_code missing;
  const std::uintmax_t bytes = fs::file_size(file, missing);
  return missing ? 0 : bytes;
}

std::atomic<int> asked_to_end{0};

/// Notes SIGINT and SIGTERM while a command runs, and restores what was there.
class EndRequests {
 public:
  EndRequests() {
    asked_to_end = 0;
    struct sigaction action {};
    action.sa_handler = [](int signal) { asked_to_end = signal; };
    sigaction(SIGINT, &action, &interrupt_);
    sigaction(SIGTERM, &action, &terminate_);
  }
  ~EndRequests() {
    sigaction(SIGINT, &interrupt_, nullptr);
    sigaction(SIGTERM, &terminate_, nullptr);
  }
  EndRequests(const EndRequests&) = delete;
  EndRequests& operator=(const EndRequests&) = delete;

 private:
  struct sigaction interrupt_ {
  }, terminate_{};
};

/// A process as /proc describes it.
struct ProcessEntry {
  pid_t id = 0, parent = 0, session = 0;
};

std::vector<ProcessEntry> list_processes() {
  std::vector<ProcessEntry> processes;
  std::error_code gone;
  for (const fs::directory_entry& entry : fs::directory_iterator("/proc", gone)) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream file(entry.path() / "stat");
    std::string text;
    std::getline(file, text);
    // The second field is the program's name in parentheses, which may hold blanks and parentheses itself.
    const std::size_t end_of_name = text.rfind(')');
    if (end_of_name == std::string::npos) continue;
    std::istringstream fields(text.substr(end_of_name + 1));
    ProcessEntry process;
    char state = 0;
    pid_t group = 0;
    if (!(fields >> state >> process.parent >> group >> process.session)) continue;
    process.id = static_cast<pid_t>(std::stol(name));
    processes.push_back(process);
  }
  return processes;
}

/// Processes of the session that `leader` leads, and descendants of them or of this process (orphans).
std::vector<ProcessEntry> command_processes(pid_t leader) {
  const std::vector<ProcessEntry> all = list_processes();
  std::set<pid_t> members;
  for (bool found = true; found;) {
    found = false;
    for (const ProcessEntry& process : all) {
      const bool belongs = process.session == leader || process.parent == getpid() || members.contains(process.parent);
      if (belongs && process.id != getpid()) found |= members.insert(process.id).second;
    }
  }
  std::vector<ProcessEntry> result;
  std::ranges::copy_if(all, std::back_inserter(result), [&](const auto& p) { return members.contains(p.id); });
  return result;
}

void signal_all(pid_t leader, int signal) {
  for (const ProcessEntry& process : command_processes(leader)) kill(process.id, signal);
}

/// Children of a process, of all its threads (proc(5): a child that ends meanwhile may hide others).
std::vector<pid_t> children_of(pid_t process) {
  std::vector<pid_t> children;
  std::error_code gone;
  for (const fs::directory_entry& thread : fs::directory_iterator("/proc/" + std::to_string(process) + "/task", gone)) {
    std::ifstream file(thread.path() / "children");
    for (pid_t child = 0; file >> child;) children.push_back(child);
  }
  return children;
}

double resident_mb_of(pid_t process) {
  static const double kPageMegabytes = static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
  std::ifstream file("/proc/" + std::to_string(process) + "/statm");  // proc(5): size, resident, in pages
  long size = 0, resident = 0;
  return file >> size >> resident ? static_cast<double>(resident) * kPageMegabytes : 0.0;
}

/// Resident memory of all descendants of this process. It follows the tree from here, since reading all processes of a
/// machine every few milliseconds takes half a core from what is measured.
double resident_mb_of_descendants() {
  double sum = 0.0;
  std::vector<pid_t> open = children_of(getpid());
  while (!open.empty()) {
    const pid_t process = open.back();
    open.pop_back();
    sum += resident_mb_of(process);
    for (const pid_t child : children_of(process)) open.push_back(child);
  }
  return sum;
}

double cpu_seconds(const rusage& used) {
  const auto seconds = [](const timeval& time) {
    return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
  };
  return seconds(used.ru_utime) + seconds(used.ru_stime);
}

/// Waits for ended children without blocking and adds what they took; nullopt while `leader` runs.
class Reaper {
 public:
  Reaper(pid_t leader, ProcessReport& report) : leader_(leader), report_(report) {}

  /// Returns whether children are left.
  bool collect() {
    for (;;) {
      int status = 0;
      rusage used{};
      const pid_t child = wait4(-1, &status, WNOHANG, &used);
      if (child < 0) return false;
      if (child == 0) return true;
      report_.cpu_seconds += cpu_seconds(used);
      report_.peak_memory_mb = std::max(report_.peak_memory_mb, static_cast<double>(used.ru_maxrss) * 1024.0 / 1e6);
      if (child != leader_) continue;
      leader_ended_ = true;
      report_.exit_status = exit_status_of(status);
    }
  }
  bool leader_ended() const { return leader_ended_; }

 private:
  pid_t leader_;
  ProcessReport& report_;
  bool leader_ended_ = false;
};

/// Ends all processes of the command that are left: asked first, unless the command has ended by itself.
void end_processes(pid_t leader, Reaper& reaper) {
  const Clock::time_point asked = Clock::now();
  signal_all(leader, SIGTERM);
  while (reaper.collect()) {
    if (Clock::now() - asked > kGracePeriod) signal_all(leader, SIGKILL);
    std::this_thread::sleep_for(kPoll);
  }
}

}  // namespace

std::vector<std::string> shell(const std::string& line) { return {"/bin/sh", "-c", line}; }

std::string describe_exit(int exit_status) {
  if (exit_status <= 128) return "exit status " + std::to_string(exit_status);
  const int signal = exit_status - 128;
  return "killed by signal " + std::to_string(signal) + " (" + strsignal(signal) + ")";
}

std::string last_line(const fs::path& log) {
  constexpr std::streamoff kReadBytes = 16384;
  constexpr std::size_t kMostBytes = 1000;
  std::ifstream stream(log, std::ios::binary | std::ios::ate);
  if (!stream) return {};
  const std::streamoff size = stream.tellg(), begin = std::max<std::streamoff>(0, size - kReadBytes);
  std::string text(static_cast<std::size_t>(size - begin), '\0');
  stream.seekg(begin).read(text.data(), size - begin);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.pop_back();
  text = text.substr(text.find_last_of('\n') + 1).substr(0, kMostBytes);
  std::ranges::replace_if(
      text, [](char c) { return c >= 0 && c < ' '; }, ' ');
  return text;
}

Process::Process(const Command& command) {
  const Launch launch(command, Group::kOwn, 0);
  process_ = launch.fork_to([&] { launch.execute(); });
  setpgid(process_, process_);  // as the child does: whoever is first
}

Process::~Process() {
  if (is_left_) return;
  kill(-process_, SIGTERM);
  if (!wait_until_gone()) kill(-process_, SIGKILL);
  wait_until_gone();
}

/// Waits up to 3 s; returns whether nothing of the process group is left.
bool Process::wait_until_gone() {
  const auto until = Clock::now() + std::chrono::seconds(3);
  while (Clock::now() < until) {
    exit_status();
    if (kill(-process_, 0) != 0) return true;
    std::this_thread::sleep_for(kPoll);
  }
  return false;
}

std::optional<int> Process::exit_status() {
  int status = 0;
  if (!exit_status_ && waitpid(process_, &status, WNOHANG) == process_) exit_status_ = exit_status_of(status);
  return exit_status_;
}

int run_guarded(const Command& command, const Patience& patience) {
  const Launch launch(command, Group::kOfParent, SIGTERM);
  const pid_t parent = getpid(), watcher = launch.fork_to([&] { watch(parent, launch, patience); });
  int status = 0;
  while (waitpid(watcher, &status, 0) < 0 && errno == EINTR) {
  }
  return exit_status_of(status);
}

std::string ProcessReport::outcome() const {
  if (out_of_time) return "stopped after " + base::rounded_text(seconds, 1) + " s, the time limit";
  if (out_of_memory) return "stopped at " + base::rounded_text(peak_memory_mb, 0) + " MB, the memory limit";
  if (out_of_log) return "stopped after it had printed " + std::to_string(kLargestLogBytes >> 20) + " MB";
  return describe_exit(exit_status);
}

ProcessReport run_measured(const Command& command, const ProcessLimits& limits) {
  const EndRequests end_requests;
  prctl(PR_SET_CHILD_SUBREAPER, 1);  // processes whose parent ends become children of this one, and are counted
  const Clock::time_point begun = Clock::now();
  const Launch launch(command, Group::kOwnSession, SIGKILL, kLargestFileBytes);
  const pid_t leader = launch.fork_to([&] { launch.execute(); });
  ProcessReport report;
  Reaper reaper(leader, report);
  const auto elapsed_s = [&] { return std::chrono::duration<double>(Clock::now() - begun).count(); };
  while (reaper.collect() && !reaper.leader_ended() && asked_to_end == 0) {
    const double resident_mb = resident_mb_of_descendants();
    report.peak_memory_mb = std::max(report.peak_memory_mb, resident_mb);
    report.out_of_memory = limits.memory_mb > 0.0 && resident_mb > limits.memory_mb;
    report.out_of_time = limits.seconds > 0.0 && elapsed_s() > limits.seconds;
    report.out_of_log = size_of(command.log) > kLargestLogBytes;
    if (report.was_stopped()) break;
    std::this_thread::sleep_for(kPoll);
  }
  report.seconds = elapsed_s();
  end_processes(leader, reaper);
  std::error_code ignored;
  if (report.out_of_log) fs::resize_file(command.log, kKeptLogBytes, ignored);
  prctl(PR_SET_CHILD_SUBREAPER, 0);
  if (const int signal = asked_to_end; signal != 0)
    throw InputError(command.words.back(), std::string("was stopped by a signal (") + strsignal(signal) + ")");
  return report;
}

}  // namespace tileflight::jobs
