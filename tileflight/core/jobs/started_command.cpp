#include "tileflight/core/jobs/started_command.h"

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <thread>
#include <utility>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::jobs {
namespace {

constexpr std::chrono::milliseconds kPatience{3000}, kPoll{20};
constexpr std::streamoff kMaxLineBytes = 200;

/// Attributes of the new process, which leads a group of its own so that all of it can be stopped.
class SpawnSetup {
 public:
  explicit SpawnSetup(const std::filesystem::path& log) {
    posix_spawnattr_init(&attributes_);
    posix_spawnattr_setpgroup(&attributes_, 0);
    sigset_t none;
    sigemptyset(&none);
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK);
    posix_spawn_file_actions_init(&files_);
    posix_spawn_file_actions_addopen(&files_, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files_, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    posix_spawn_file_actions_adddup2(&files_, STDOUT_FILENO, STDERR_FILENO);
  }
  ~SpawnSetup() {
    posix_spawn_file_actions_destroy(&files_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnSetup(const SpawnSetup&) = delete;
  SpawnSetup& operator=(const SpawnSetup&) = delete;

  posix_spawnattr_t attributes_;
  posix_spawn_file_actions_t files_;
};

}  // namespace

StartedCommand::StartedCommand(const std::string& command, const std::filesystem::path& folder,
                               std::filesystem::path log)
    : log_(std::move(log)) {
  SpawnSetup setup(log_);
  std::string shell = "sh", flag = "-c", script = "cd " + base::shell_word(folder.string()) + " && " + command;
  char* const words[] = {shell.data(), flag.data(), script.data(), nullptr};
  const int fault = posix_spawn(&process_, "/bin/sh", &setup.files_, &setup.attributes_, words, environ);
  if (fault != 0) throw InputError("command `" + command + "`", std::string("cannot be started: ") + strerror(fault));
}

StartedCommand::~StartedCommand() {
  kill(-process_, SIGTERM);
  if (!wait_until_gone(kPatience)) kill(-process_, SIGKILL);
  wait_until_gone(kPatience);
}

/// Whether nothing of the process group is left.
bool StartedCommand::wait_until_gone(std::chrono::milliseconds patience) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (std::chrono::steady_clock::now() < until) {
    end();
    if (kill(-process_, 0) != 0) return true;
    std::this_thread::sleep_for(kPoll);
  }
  return false;
}

std::optional<std::string> StartedCommand::end() {
  int status = 0;
  if (!status_ && waitpid(process_, &status, WNOHANG) == process_) status_ = status;
  if (!status_) return std::nullopt;
  if (WIFSIGNALED(*status_)) return "killed by signal " + std::to_string(WTERMSIG(*status_));
  return "exit status " + std::to_string(WEXITSTATUS(*status_));
}

std::string StartedCommand::last_line() const {
  std::ifstream stream(log_, std::ios::binary | std::ios::ate);
  if (!stream) return {};
  const std::streamoff size = stream.tellg(), begin = std::max<std::streamoff>(0, size - 10 * kMaxLineBytes);
  std::string text(static_cast<std::size_t>(size - begin), '\0');
  stream.seekg(begin).read(text.data(), size - begin);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.pop_back();
  text = text.substr(text.find_last_of('\n') + 1).substr(0, static_cast<std::size_t>(kMaxLineBytes));
  std::ranges::replace_if(
      text, [](char c) { return c >= 0 && c < ' '; }, ' ');
  return text;
}

}  // namespace tileflight::jobs
