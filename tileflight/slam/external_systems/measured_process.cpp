#include "tileflight/slam/external_systems/measured_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <set>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::external_systems {
namespace fs = std::filesystem;
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kSamplingInterval{20};
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

[[noreturn]] void execute(const std::string& command, const fs::path& folder,
                          const std::map<std::string, std::string>& environment, const fs::path& log) {
  setsid();
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  const int input = open("/dev/null", O_RDONLY | O_CLOEXEC);
  if (output < 0 || input < 0 || chdir(folder.c_str()) != 0) _exit(126);
  dup2(input, STDIN_FILENO);
  dup2(output, STDOUT_FILENO);
  dup2(output, STDERR_FILENO);
  for (const auto& [name, value] : environment) setenv(name.c_str(), value.c_str(), 1);
  for (const int signal : {SIGPIPE, SIGXFSZ, SIGINT, SIGTERM}) std::signal(signal, SIG_DFL);
  const rlimit largest{.rlim_cur = kLargestFileBytes, .rlim_max = kLargestFileBytes};
  setrlimit(RLIMIT_FSIZE, &largest);
  execl("/bin/sh", "sh", "-c", command.c_str(), static_cast<char*>(nullptr));
  _exit(127);
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
      report_.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
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
    std::this_thread::sleep_for(kSamplingInterval);
  }
}

}  // namespace

std::string ProcessReport::outcome() const {
  if (out_of_time) return "stopped after " + base::rounded_text(seconds, 1) + " s, the time limit";
  if (out_of_memory) return "stopped at " + base::rounded_text(peak_memory_mb, 0) + " MB, the memory limit";
  if (out_of_log) return "stopped after it had printed " + std::to_string(kLargestLogBytes >> 20) + " MB";
  if (exit_status > 128) {
    const int signal = exit_status - 128;
    return "killed by signal " + std::to_string(signal) + " (" + strsignal(signal) + ")";
  }
  return "exit status " + std::to_string(exit_status);
}

ProcessReport run_measured(const std::string& command, const fs::path& folder,
                           const std::map<std::string, std::string>& environment, const fs::path& log,
                           const ProcessLimits& limits) {
  const EndRequests end_requests;
  prctl(PR_SET_CHILD_SUBREAPER, 1);  // processes whose parent ends become children of this one, and are counted
  const Clock::time_point begun = Clock::now();
  const pid_t leader = fork();
  if (leader < 0) throw InputError("process", std::string("cannot be started: ") + std::strerror(errno));
  if (leader == 0) execute(command, folder, environment, log);
  ProcessReport report;
  Reaper reaper(leader, report);
  const auto elapsed_s = [&] { return std::chrono::duration<double>(Clock::now() - begun).count(); };
  while (reaper.collect() && !reaper.leader_ended() && asked_to_end == 0) {
    const double resident_mb = resident_mb_of_descendants();
    report.peak_memory_mb = std::max(report.peak_memory_mb, resident_mb);
    report.out_of_memory = limits.memory_mb > 0.0 && resident_mb > limits.memory_mb;
    report.out_of_time = limits.seconds > 0.0 && elapsed_s() > limits.seconds;
    report.out_of_log = size_of(log) > kLargestLogBytes;
    if (report.was_stopped()) break;
    std::this_thread::sleep_for(kSamplingInterval);
  }
  report.seconds = elapsed_s();
  end_processes(leader, reaper);
  std::error_code ignored;
  if (report.out_of_log) fs::resize_file(log, kKeptLogBytes, ignored);
  prctl(PR_SET_CHILD_SUBREAPER, 0);
  if (const int signal = asked_to_end; signal != 0)
    throw InputError(command, std::string("was stopped by a signal (") + strsignal(signal) + ")");
  return report;
}

}  // namespace tileflight::external_systems
