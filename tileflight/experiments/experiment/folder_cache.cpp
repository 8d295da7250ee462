#include "tileflight/experiments/experiment/folder_cache.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::experiment {

namespace fs = std::filesystem;

void link_files(const fs::path& from, const fs::path& to) {
  for (const fs::directory_entry& entry : fs::directory_iterator(from)) {
    const fs::path target = to / entry.path().filename();
    std::error_code fault;
    if (entry.is_symlink()) {
      fs::copy_symlink(entry.path(), target, fault);
    } else if (entry.is_directory()) {
      fs::create_directory(target, fault);
      if (!fault) link_files(entry.path(), target);
    } else {
      fs::create_hard_link(entry.path(), target, fault);
      if (fault) fs::copy_file(entry.path(), target, fault);
    }
    if (fault) throw InputError(target.string(), "cannot be written: " + fault.message());
  }
}

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// An entry that one process makes or reads at a time. The kernel releases the lock when the process ends. On a file
/// system without locks two processes may make the same entry, each whole.
class EntryLock {
 public:
  EntryLock(const fs::path& file, const std::string& what, const Progress& progress)
      : file_(::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666)) {
    if (file_ < 0) throw InputError(file.string(), "cannot be written: " + std::system_category().message(errno));
    if (::flock(file_, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    report_progress(progress, 0, 0, "waiting for another process that makes the same " + what);
    while (::flock(file_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~EntryLock() { ::close(file_); }
  EntryLock(const EntryLock&) = delete;
  EntryLock& operator=(const EntryLock&) = delete;

 private:
  int file_;
};

fs::path manifest_of(const fs::path& entry) { return entry.string() + ".json"; }

/// Size and time of change of a file's content; null if it is not there.
json stamp_of(const fs::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) return nullptr;
  return {{"bytes", static_cast<std::int64_t>(status.st_size)},
          {"modified_ns", static_cast<std::int64_t>(status.st_mtim.tv_sec) * 1'000'000'000 + status.st_mtim.tv_nsec}};
}

json stamps_of(const fs::path& entry) {
  json stamps = json::object();
  for (const std::string& file : base::list_files_recursive(entry)) stamps[file] = stamp_of(entry / file);
  return stamps;
}

/// Whether all files are there as they were written.
bool is_whole(const fs::path& entry) {
  const fs::path manifest = manifest_of(entry);
  if (!fs::is_directory(entry) || !fs::is_regular_file(manifest)) return false;
  const json written = json::parse(base::read_raw(manifest), nullptr, false);
  return written.is_object() && !written.empty() && written == stamps_of(entry);
}

}  // namespace

SharedKind shared_truths(const std::string& source) {
  const auto name_source = [source](const fs::path& truth) {
    place::ExtractResult about = place::read_extract_json(truth);
    if (about.source == source) return;
    about.source = source;
    place::write_extract_json(about, truth);
  };
  return {.command = "extract", .name = "truth", .adapt = name_source};
}

SharedKind shared_places() { return {.command = "scene", .name = "built-in place"}; }

FolderCache::FolderCache(fs::path folder, SharedKind kind, bool refresh, const Progress& progress)
    : folder_(std::move(folder)), kind_(std::move(kind)), refresh_(refresh), progress_(progress) {}

bool FolderCache::take(const std::string& key, const fs::path& to) const {
  if (folder_.empty() || refresh_ || !fs::exists(manifest_of(folder_ / key))) return false;
  const EntryLock lock(folder_ / (key + ".lock"), kind_.name, progress_);
  return is_whole(folder_ / key) && link(key, to);
}

void FolderCache::make(const std::string& key, const fs::path& to, const Write& write) const {
  if (folder_.empty()) return write(to);
  base::make_folder(folder_);
  const fs::path entry = folder_ / key;
  const EntryLock lock(folder_ / (key + ".lock"), kind_.name, progress_);
  if (refresh_ || !is_whole(entry)) {
    std::error_code ignored;
    fs::remove(manifest_of(entry), ignored);
    write(entry);
    base::write_file(manifest_of(entry), stamps_of(entry).dump(2) + "\n");
  }
  if (!link(key, to)) write(to);
}

/// False if the entry is removed meanwhile.
bool FolderCache::link(const std::string& key, const fs::path& to) const {
  const base::OutputFolder output{.folder = to, .command = kind_.command, .replace = true};
  base::require_writable(output);
  try {
    base::write_folder(output, [&](const fs::path& temporary) {
      link_files(folder_ / key, temporary);
      if (kind_.adapt) kind_.adapt(temporary);
    });
  } catch (const InputError&) {
    if (fs::exists(folder_ / key)) throw;
    return false;
  }
  return true;
}

}  // namespace tileflight::experiment
