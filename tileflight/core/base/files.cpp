#include "tileflight/core/base/files.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::base {
namespace fs = std::filesystem;

namespace {

constexpr std::string_view kTemporary = ".tmp";
constexpr std::string_view kMovedAside = ".old";

std::string start_of_names(const fs::path& target) { return "." + target.filename().string() + "."; }

/// The process id in "PID-N"; 0 if the text has another form.
pid_t process_of(std::string_view text) {
  const std::size_t dash = text.find('-');
  if (dash == std::string_view::npos) return 0;
  const std::string_view attempt = text.substr(dash + 1);
  const bool digits =
      !attempt.empty() && std::all_of(attempt.begin(), attempt.end(), [](char c) { return c >= '0' && c <= '9'; });
  pid_t process = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + dash, process);
  return digits && fault == std::errc() && end == text.data() + dash && process > 0 ? process : 0;
}

bool runs(pid_t process) { return ::kill(process, 0) == 0 || errno != ESRCH; }

bool is_abandoned(const std::string& name, const std::string& start, std::string_view ending) {
  if (name.size() <= start.size() + ending.size() || !name.starts_with(start) || !name.ends_with(ending)) return false;
  const pid_t process =
      process_of(std::string_view(name).substr(start.size(), name.size() - start.size() - ending.size()));
  return process > 0 && !runs(process);
}

/// Folders that cannot be listed give an empty result.
std::vector<fs::path> abandoned_beside(const fs::path& target, std::string_view ending) {
  const std::string start = start_of_names(target);
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  std::vector<fs::path> abandoned;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error)) {
    if (is_abandoned(entry->path().filename().string(), start, ending)) abandoned.push_back(entry->path());
  }
  return abandoned;
}

/// Files that cannot be removed are left: they do no harm.
void remove_all(const std::vector<fs::path>& paths) {
  std::error_code ignored;
  for (const fs::path& path : paths) fs::remove_all(path, ignored);
}

fs::path new_name_beside(const fs::path& target, std::string_view ending) {
  for (int attempt = 0;; ++attempt) {
    const fs::path candidate = target.parent_path() / (start_of_names(target) + std::to_string(::getpid()) + "-" +
                                                       std::to_string(attempt) + std::string(ending));
    std::error_code error;
    if (!fs::exists(fs::symlink_status(candidate, error))) return candidate;
  }
}

/// Text of an errno value, such as "No space left on device", as the second half of a message.
std::string cause(int error) { return std::system_category().message(error); }

/// An open file descriptor, closed with the object.
class Descriptor {
 public:
  Descriptor(const fs::path& file, int flags)
      : file_(file.string()), fd_(::open(file.c_str(), flags | O_CLOEXEC, 0666)) {
    if (fd_ < 0) throw InputError(file_, "cannot be opened: " + cause(errno));
  }
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  /// Returns fewer bytes than `size` only at the end of the file.
  std::size_t read(char* data, std::size_t size) const {
    std::size_t done = 0;
    while (done < size) {
      const ssize_t n = ::read(fd_, data + done, size - done);
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw InputError(file_, "cannot be read: " + cause(errno));
      if (n == 0) break;
      done += static_cast<std::size_t>(n);
    }
    return done;
  }

  void write(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ssize_t n = ::write(fd_, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw InputError(file_, "cannot be written: " + cause(errno));
      bytes.remove_prefix(static_cast<std::size_t>(n));
    }
  }

  /// Network and quota file systems report a full disk only here.
  void close() {
    const int result = ::close(fd_);
    fd_ = -1;
    if (result != 0) throw InputError(file_, "cannot be written: " + cause(errno));
  }

 private:
  std::string file_;
  int fd_;
};

/// Size reported for a regular file; 0 for pipes and devices, which are read to their end.
std::uintmax_t size_hint(const fs::path& file) {
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0) throw InputError(file.string(), "cannot be opened: " + cause(errno));
  if (S_ISDIR(status.st_mode)) throw InputError(file.string(), "is a folder, expected a file");
  return S_ISREG(status.st_mode) ? static_cast<std::uintmax_t>(status.st_size) : 0;
}

template <typename Buffer>
Buffer read_whole(const fs::path& file, std::uintmax_t max_bytes) {
  const auto too_large = [&] {
    return InputError(file.string(), "is larger than the limit of " + std::to_string(max_bytes) + " bytes");
  };
  const std::uintmax_t size = size_hint(file);
  if (size > max_bytes) throw too_large();
  const Descriptor descriptor(file, O_RDONLY);
  Buffer buffer;
  std::size_t done = 0;
  // One byte more than expected, so that the usual file is read in the first round.
  std::size_t room = static_cast<std::size_t>(size) + 1;
  while (true) {
    buffer.resize(done + room);
    const std::size_t n = descriptor.read(reinterpret_cast<char*>(buffer.data()) + done, room);
    done += n;
    if (done > max_bytes) throw too_large();
    if (n < room) break;
    room = std::max<std::size_t>(done, 4096);
  }
  buffer.resize(done);
  return buffer;
}

}  // namespace

fs::path make_temporary_path(const fs::path& target) {
  remove_all(abandoned_beside(target, kTemporary));
  return new_name_beside(target, kTemporary);
}

bool is_abandoned_temporary(const fs::path& file_name) {
  const std::string name = file_name.string();
  if (!name.starts_with('.') || !name.ends_with(kTemporary)) return false;
  const std::size_t dot = name.rfind('.', name.size() - kTemporary.size() - 1);
  return dot != std::string::npos && dot > 0 && is_abandoned(name, name.substr(0, dot + 1), kTemporary);
}

fs::path make_backup_path(const fs::path& target) { return new_name_beside(target, kMovedAside); }

void restore_backup(const fs::path& target) {
  std::vector<fs::path> moved = abandoned_beside(target, kMovedAside);
  std::error_code error;
  if (!moved.empty() && !fs::exists(fs::symlink_status(target, error))) {
    fs::rename(moved.back(), target, error);
    if (!error) moved.pop_back();
  } else {
    remove_all(moved);
  }
}

void rename_or_throw(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::rename(from, to, error);
  if (error) throw InputError(to.string(), "cannot be written: " + error.message());
}

nlohmann::json read_json(const std::filesystem::path& file) {
  nlohmann::json value = nlohmann::json::parse(read_text(file), nullptr, false);
  if (value.is_discarded()) throw InputError(file.string(), "is not valid JSON");
  return value;
}

namespace {

/// Tells UTF-16 by its byte order mark, or by the zeros beside its first two characters.
bool is_utf16(std::string_view bytes) {
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF")) return true;
  const auto is_ascii = [](char c) { return (c >= ' ' && c <= '~') || c == '\n' || c == '\r' || c == '\t'; };
  const auto has_zeros = [&](std::size_t first) {
    return bytes[first] == '\0' && bytes[first + 2] == '\0' && is_ascii(bytes[1 - first]) && is_ascii(bytes[3 - first]);
  };
  return bytes.size() >= 4 && (has_zeros(0) || has_zeros(1));
}

}  // namespace

std::string read_text(const fs::path& file, std::uintmax_t max_bytes) {
  std::string text = read_raw(file, max_bytes);
  if (is_utf16(text))
    throw InputError(file.string(),
                     "is text in UTF-16; convert it: iconv -f UTF-16 -t UTF-8 FILE > NEW, or save it as UTF-8");
  text.erase(0, text.size() - strip_byte_order_mark(text).size());
  return text;
}

std::string read_raw(const fs::path& file, std::uintmax_t max_bytes) {
  return read_whole<std::string>(file, max_bytes);
}

std::vector<std::byte> read_bytes(const fs::path& file, std::uintmax_t max_bytes) {
  return read_whole<std::vector<std::byte>>(file, max_bytes);
}

void write_file_in_parts(const fs::path& file, const std::function<std::string_view()>& next) {
  const auto write_all = [&](const Descriptor& descriptor) {
    for (std::string_view part = next(); !part.empty(); part = next()) descriptor.write(part);
  };
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::is_directory(status)) throw InputError(file.string(), "is a folder; choose a file name to write");
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    // Devices and pipes are written to, never replaced.
    Descriptor descriptor(file, O_WRONLY);
    write_all(descriptor);
    return descriptor.close();
  }
  const fs::path target = fs::is_symlink(fs::symlink_status(file, error)) ? fs::weakly_canonical(file) : file;
  const fs::path temporary = make_temporary_path(target);
  const RemovedOnExit remove_temporary(temporary);
  Descriptor descriptor(temporary, O_WRONLY | O_CREAT | O_EXCL);
  write_all(descriptor);
  descriptor.close();
  rename_or_throw(temporary, target);
}

std::string sha256_hex_of_file(const fs::path& file) {
  size_hint(file);  // reports a folder as such, not as an unreadable file
  const Descriptor descriptor(file, O_RDONLY);
  std::string block(std::size_t{1} << 20, '\0');
  Sha256 hash;
  while (const std::size_t n = descriptor.read(block.data(), block.size())) hash.add({block.data(), n});
  return hash.hex();
}

void write_file(const fs::path& file, std::string_view bytes) {
  write_file_in_parts(file, [rest = bytes]() mutable { return std::exchange(rest, std::string_view()); });
}

}  // namespace tileflight::base
