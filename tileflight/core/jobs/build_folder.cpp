#include "tileflight/core/jobs/build_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/make_folder.h"

namespace tileflight::jobs {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

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

fs::path BuildFolder::path_beside(const fs::path& output, const std::string& kind) {
  fs::path target = fs::absolute(output).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() / ("." + target.filename().string() + "." + kind);
}

json BuildFolder::read_inputs(const fs::path& folder) {
  try {
    return json::parse(base::read_text(folder / kInputs, kMaxInputsBytes));
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
