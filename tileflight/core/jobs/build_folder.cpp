#include "tileflight/core/jobs/build_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <system_error>
#include <thread>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
using nlohmann::json;

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
  std::istringstream text(base::read_raw(lock, kMaxLockBytes));
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
  std::istringstream text(base::read_raw(lock, kMaxLockBytes));
  pid_t process = 0;
  std::string host;
  return (text >> process >> host) && host == host_name() && ::kill(process, 0) != 0 && errno == ESRCH;
}

/// Returns whether the lock was got. Waits for the rest of a killed owner, which is about to end (process.h).
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

constexpr std::uintmax_t kMaxInputsBytes = 1 << 20;
constexpr const char* kMembers = "members";
constexpr const char* kInputs = "inputs.json";
constexpr const char* kPreparing = "preparing";

enum class LockState { kOurs, kTaken, kNone };

/// A file, locked exclusively while the object lives.
class LockedFile {
 public:
  LockedFile(const fs::path& file, bool wait) : descriptor_(::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) throw InputError(file.string(), "cannot be written: " + std::system_category().message(errno));
    int result = 0;
    do {
      result = ::flock(descriptor_, wait ? LOCK_EX : LOCK_EX | LOCK_NB);
    } while (result != 0 && errno == EINTR);
    state_ = result == 0 ? LockState::kOurs : errno == EWOULDBLOCK ? LockState::kTaken : LockState::kNone;
  }
  ~LockedFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  LockedFile(const LockedFile&) = delete;
  LockedFile& operator=(const LockedFile&) = delete;

  LockState state() const { return state_; }
  /// The descriptor, which the caller closes.
  int release() { return std::exchange(descriptor_, -1); }

 private:
  int descriptor_;
  LockState state_ = LockState::kNone;
};

bool is_locked(const fs::path& file) {
  return fs::exists(file) && LockedFile(file, false).state() == LockState::kTaken;
}

/// Files of parts are named apart from those of whole jobs.
std::string file_name(const std::string& name, Share share) {
  return (share == Share::kPart ? "part-" : "whole-") + name;
}

/// Whether a process at work there keeps one of this share out.
bool any_member(const fs::path& folder, Share share) {
  std::error_code error;
  for (fs::directory_iterator entry(folder / kMembers, error), end; !error && entry != end; entry.increment(error)) {
    const bool is_beside = share == Share::kPart && entry->path().filename().string().starts_with("part-");
    if (!is_beside && is_locked(entry->path())) return true;
  }
  return false;
}

[[noreturn]] void refuse(const fs::path& folder) {
  throw InputError(folder.string(),
                   "another process is working in it; wait until it has ended, or choose another --out");
}

/// The names of the keys that differ: "program, settings".
std::string differences(const json& before, const json& now) {
  std::string names;
  for (const auto& [key, value] : now.items()) {
    if (before.is_object() && before.contains(key) && before[key] == value) continue;
    names += (names.empty() ? "" : ", ") + key;
  }
  return names;
}

void remove_all_but_lock(const fs::path& folder) {
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().filename() == kPreparing) continue;
    fs::remove_all(entry->path(), error);
    if (error) throw InputError(entry->path().string(), "cannot be removed: " + error.message());
  }
}

}  // namespace

FolderLock::FolderLock(const fs::path& folder) : file_(lock_folder(folder)) {}

FolderLock::~FolderLock() {
  if (file_ < 0) return;
  [[maybe_unused]] const int ignored = ::ftruncate(file_, 0);  // harmless on failure: the lock itself is released
  ::close(file_);
}

fs::path BuildFolder::path_beside(const fs::path& output, const std::string& kind) {
  fs::path target = fs::absolute(output).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() / ("." + target.filename().string() + "." + kind);
}

json BuildFolder::read_inputs(const fs::path& folder) {
  try {
    return json::parse(base::read_raw(folder / kInputs, kMaxInputsBytes));
  } catch (const std::exception&) {
    return nullptr;
  }
}

std::string BuildFolder::prepare(const fs::path& folder, const json& inputs, Share share,
                                 const std::vector<std::string>& folders) {
  base::make_folder(folder);
  // Parts of a job may begin at the same time.
  const LockedFile preparing(folder / kPreparing, true);
  if (any_member(folder, share)) refuse(folder);
  const json before = read_inputs(folder);
  const bool is_whole = std::ranges::all_of(folders, [&](const auto& part) { return fs::is_directory(folder / part); });
  std::string note;
  if (before != inputs || !is_whole) {
    if (any_member(folder, Share::kWhole)) refuse(folder);
    const bool was_used = fs::exists(folder / kInputs);
    if (was_used) note = "because these inputs differ: " + differences(before, inputs);
    remove_all_but_lock(folder);
  } else if (share == Share::kWhole) {
    std::error_code ignored;
    fs::remove_all(folder / kMembers, ignored);
  }
  base::make_folder(folder / kMembers);
  for (const std::string& part : folders) base::make_folder(folder / part);
  if (before != inputs) base::write_file(folder / kInputs, inputs.dump(1));
  return note;
}

BuildFolder::BuildFolder(fs::path folder, const std::string& name, Share share) : folder_(std::move(folder)) {
  LockedFile lock(folder_ / kMembers / file_name(name, share), share == Share::kPart);
  if (lock.state() == LockState::kTaken) refuse(folder_);
  lock_ = lock.release();
}

BuildFolder::~BuildFolder() {
  if (lock_ >= 0) ::close(lock_);
}

void BuildFolder::remove() const {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace tileflight::jobs
