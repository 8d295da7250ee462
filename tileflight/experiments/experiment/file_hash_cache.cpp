#include "tileflight/experiments/experiment/file_hash_cache.h"

#include <oneapi/tbb/parallel_for.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <set>
#include <sstream>
#include <system_error>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

/// Two changes of a file within the resolution of its times leave the same stamp, so recently changed files are read
/// again. Two seconds is the coarsest resolution in use (FAT).
constexpr std::int64_t kSettled_ns = 2'000'000'000;
constexpr std::uintmax_t kMaxSettings_bytes = 16 << 20;

std::int64_t nanoseconds(const timespec& time) {
  return static_cast<std::int64_t>(time.tv_sec) * 1'000'000'000 + time.tv_nsec;
}

std::int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_REALTIME, &now);
  return nanoseconds(now);
}

/// Collects the files below a folder that are part of its content.
class FolderWalk {
 public:
  explicit FolderWalk(const std::vector<fs::path>& left_out) {
    for (const fs::path& folder : left_out) visited_.insert(fs::weakly_canonical(folder));
  }

  void add(const fs::path& folder) {
    if (!visited_.insert(fs::canonical(folder)).second) return;  // links may form a cycle
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
      if (entry.path().filename().native().starts_with('.')) continue;
      if (entry.is_regular_file()) files_.push_back(entry.path());
      if (entry.is_directory() && !base::is_result_folder(entry.path())) add(entry.path());
    }
  }

  std::vector<fs::path> files() && {
    std::ranges::sort(files_);
    return std::move(files_);
  }

 private:
  std::set<fs::path> visited_;
  std::vector<fs::path> files_;
};

}  // namespace

FileHashCache::FileHashCache(fs::path memory) : cache_file_(std::move(memory)) { read_cache(); }

FileHashCache::FileStamp FileHashCache::read_stamp(const fs::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0)
    throw InputError(file.string(), "cannot be read: " + std::system_category().message(errno));
  return {static_cast<std::uintmax_t>(status.st_size), static_cast<std::uint64_t>(status.st_ino),
          nanoseconds(status.st_mtim), nanoseconds(status.st_ctim)};
}

std::string FileHashCache::hash_file(const fs::path& file) const {
  const std::string name = fs::absolute(file).lexically_normal().string();
  const std::int64_t begin_ns = now_ns();
  const FileStamp stamp = read_stamp(file);
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(name);
    if (found != entries_.end() && found->second.stamp == stamp) return found->second.sha256;
  }
  const std::string sha256 = base::sha256_hex_of_file(file);
  const bool is_settled = std::max(stamp.modified_ns, stamp.changed_ns) + kSettled_ns < begin_ns;
  const std::lock_guard lock(mutex_);
  is_changed_ = is_changed_ || is_settled || entries_.contains(name);
  if (is_settled) {
    entries_[name] = {stamp, sha256};
  } else {
    entries_.erase(name);
  }
  return sha256;
}

std::string FileHashCache::hash(const fs::path& file_or_folder, const std::vector<fs::path>& left_out) const {
  if (!fs::exists(file_or_folder)) throw InputError(file_or_folder.string(), "no such file or folder");
  if (!fs::is_directory(file_or_folder)) return hash_file(file_or_folder);
  std::vector<fs::path> files;
  try {
    FolderWalk walk(left_out);
    walk.add(file_or_folder);
    files = std::move(walk).files();
  } catch (const fs::filesystem_error& fault) {
    throw InputError(file_or_folder.string(), "cannot be listed: " + fault.code().message());
  }
  std::vector<std::string> lines(files.size());
  oneapi::tbb::parallel_for(std::size_t{0}, files.size(), [&](std::size_t i) {
    lines[i] = hash_file(files[i]) + " " + files[i].lexically_relative(file_or_folder).generic_string() + "\n";
  });
  std::string list;
  for (const std::string& line : lines) list += line;
  return base::sha256_hex(list);
}

std::string FileHashCache::hash_yaml_content(const fs::path& file) {
  return base::sha256_hex(base::canonical_yaml_text(base::read_text(file, kMaxSettings_bytes)));
}

// One line per file: SHA-256, bytes, inode, mtime and ctime in nanoseconds, path.
void FileHashCache::read_cache() {
  if (cache_file_.empty() || !fs::is_regular_file(cache_file_)) return;
  std::istringstream lines(base::read_raw(cache_file_));
  for (std::string line; std::getline(lines, line);) {
    std::istringstream fields(line);
    Entry known;
    FileStamp& stamp = known.stamp;
    std::string path;
    if (fields >> known.sha256 >> stamp.bytes >> stamp.inode >> stamp.modified_ns >> stamp.changed_ns &&
        fields.get() == ' ' && std::getline(fields, path) && known.sha256.size() == 64)
      entries_[path] = known;
  }
}

void FileHashCache::save() const {
  const std::lock_guard lock(mutex_);
  if (cache_file_.empty() || !is_changed_) return;
  std::string text;
  for (const auto& [path, known] : entries_) {
    if (path.find('\n') != std::string::npos) continue;
    const FileStamp& stamp = known.stamp;
    text += known.sha256 + " " + std::to_string(stamp.bytes) + " " + std::to_string(stamp.inode) + " " +
            std::to_string(stamp.modified_ns) + " " + std::to_string(stamp.changed_ns) + " " + path + "\n";
  }
  try {
    base::write_file(cache_file_, text);
    is_changed_ = false;
  } catch (const InputError&) {  // the cache is optional
  }
}

}  // namespace tileflight::experiment
