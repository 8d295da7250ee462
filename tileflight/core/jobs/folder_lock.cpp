#include "tileflight/core/jobs/folder_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <fstream>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

constexpr std::uintmax_t kMaxLockBytes = 4096;

std::string host_name() {
  std::array<char, 256> name{};
  return ::gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

/// "tileflight run a.yaml --out out" of a local process; empty if it cannot be read.
std::string read_command_line(const std::string& process) {
  std::ifstream file("/proc/" + process + "/cmdline", std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  std::string command = text.str();
  while (!command.empty() && command.back() == '\0') command.pop_back();
  std::replace_if(
      command.begin(), command.end(), [](unsigned char c) { return c < 0x20; }, ' ');
  return command;
}

/// "process 4711 (tileflight run a.yaml --out out)", as stored in the lock file.
std::string read_owner(const fs::path& lock) {
  std::istringstream text(base::read_text(lock, kMaxLockBytes));
  std::string process, host;
  if (!(text >> process >> host)) return "another process";
  if (host != host_name()) return "process " + process + " of " + host;
  const std::string command = read_command_line(process);
  return "process " + process + (command.empty() ? "" : " (" + command + ")");
}

/// Stores the owner of the lock.
void write_owner(int lock) {
  const std::string text = std::to_string(::getpid()) + " " + host_name() + "\n";
  if (::ftruncate(lock, 0) != 0 || ::pwrite(lock, text.data(), text.size(), 0) < 0) return;  // the owner is unknown
}

/// Whether the owner of a lock was killed, so that only what it had started still holds the lock.
bool is_owner_gone(const fs::path& lock) {
  std::istringstream text(base::read_text(lock, kMaxLockBytes));
  pid_t process = 0;
  std::string host;
  return (text >> process >> host) && host == host_name() && ::kill(process, 0) != 0 && errno == ESRCH;
}

/// Returns whether the lock was got. Waits for the rest of a killed owner, which is about to end (guarded_program.h).
bool try_lock(int lock, const fs::path& file) {
  constexpr std::chrono::milliseconds kPoll{50}, kPatience{30000};
  for (auto waited = 0 * kPoll;; waited += kPoll) {
    if (::flock(lock, LOCK_EX | LOCK_NB) == 0) return true;
    const int fault = errno;
    if (fault != EWOULDBLOCK || !is_owner_gone(file) || waited >= kPatience) {
      errno = fault;
      return false;
    }
    std::this_thread::sleep_for(kPoll);
  }
}

int lock_folder(const fs::path& folder) {
  const fs::path file = folder / FolderLock::kFile;
  const int lock = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (lock < 0) throw InputError(file.string(), "cannot be written: " + std::system_category().message(errno));
  if (try_lock(lock, file)) {
    write_owner(lock);
    return lock;
  }
  const bool is_busy = errno == EWOULDBLOCK;
  ::close(lock);
  if (!is_busy) return -1;
  throw InputError(folder.string(),
                   read_owner(file) + " is using it; wait until it has ended, or choose another folder for --out");
}

}  // namespace

FolderLock::FolderLock(const fs::path& folder) : file_(lock_folder(folder)) {}

FolderLock::~FolderLock() {
  if (file_ < 0) return;
  [[maybe_unused]] const int ignored = ::ftruncate(file_, 0);  // harmless on failure: the lock itself is released
  ::close(file_);
}

}  // namespace tileflight::jobs
