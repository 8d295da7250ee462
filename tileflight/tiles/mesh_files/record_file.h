#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <system_error>
#include <type_traits>
#include <vector>

#include "tileflight/core/base/input_error.h"

namespace tileflight::mesh_files {

/// A temporary file for working with more than fits into memory. Throws InputError (file, cause), such as "cannot be
/// written: No space left on device".
class ScratchFile {
 public:
  explicit ScratchFile(const std::filesystem::path& file)
      : name_(file.string()), descriptor_(::open(file.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) throw fault("cannot be written");
  }
  ~ScratchFile() { ::close(descriptor_); }
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  void write(std::uint64_t offset, const void* bytes, std::size_t size) const {
    const char* from = static_cast<const char*>(bytes);
    while (size > 0) {
      const ssize_t n = ::pwrite(descriptor_, from, size, static_cast<off_t>(offset));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw fault("cannot be written");
      from += n;
      offset += static_cast<std::uint64_t>(n);
      size -= static_cast<std::size_t>(n);
    }
  }

  /// Reads bytes that have been written. May be called from several threads.
  void read(std::uint64_t offset, void* bytes, std::size_t size) const {
    char* to = static_cast<char*>(bytes);
    while (size > 0) {
      const ssize_t n = ::pread(descriptor_, to, size, static_cast<off_t>(offset));
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) throw fault("cannot be read");
      if (n == 0) throw InputError(name_, "was changed by another program while it was used");
      to += n;
      offset += static_cast<std::uint64_t>(n);
      size -= static_cast<std::size_t>(n);
    }
  }

 private:
  InputError fault(const std::string& what) const {
    return InputError(name_, what + ": " + std::system_category().message(errno));
  }

  std::string name_;
  int descriptor_;
};

/// A list of records on disk with a small cache in memory: appended in order, then read in any order, faster if
/// neighbours follow each other. For one thread.
template <class Record>
class RecordFile {
  static_assert(std::is_trivially_copyable_v<Record>);

 public:
  explicit RecordFile(const std::filesystem::path& file) : file_(file) {}

  std::uint64_t size() const { return written_ + tail_.size(); }

  void push_back(const Record& record) {
    tail_.push_back(record);
    if (tail_.size() == kTail) flush();
  }

  Record at(std::uint64_t index) const {
    assert(index < size());
    if (index >= written_) return tail_[index - written_];
    const std::uint64_t page = index / kPage;
    Slot& slot = slot_of(page);
    if (slot.page != page) {
      const std::uint64_t first = page * kPage;
      slot.records.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kPage, written_ - first)));
      file_.read(first * sizeof(Record), slot.records.data(), slot.records.size() * sizeof(Record));
      // A page that is not full yet is read again the next time.
      slot.page = slot.records.size() == kPage ? page : kNoPage;
    }
    return slot.records[index % kPage];
  }

  /// Changes the records from `first` on, in order.
  template <class Change>
  void change(std::uint64_t first, const Change& change_record) {
    std::vector<Record> part;
    for_each_part(first, part, [&](std::uint64_t begin) {
      for (Record& record : part) change_record(record);
      file_.write(begin * sizeof(Record), part.data(), part.size() * sizeof(Record));
    });
    slots_.clear();
  }

  /// Calls `visit(record)` for the records in order.
  template <class Visit>
  void for_each(const Visit& visit) {
    std::vector<Record> part;
    for_each_part(0, part, [&](std::uint64_t) {
      for (const Record& record : part) visit(record);
    });
  }

 private:
  static constexpr std::uint64_t kPage = 256;                 ///< records read together
  static constexpr std::size_t kSlots = 4096;                 ///< pages in memory
  static constexpr std::size_t kTail = std::size_t{1} << 16;  ///< records written together: whole pages
  static constexpr std::uint64_t kNoPage = ~std::uint64_t{0};

  struct Slot {
    std::uint64_t page = kNoPage;
    std::vector<Record> records;
  };

  Slot& slot_of(std::uint64_t page) const {
    if (slots_.empty()) slots_.resize(kSlots);
    return slots_[page % kSlots];
  }

  void flush() {
    file_.write(written_ * sizeof(Record), tail_.data(), tail_.size() * sizeof(Record));
    written_ += tail_.size();
    tail_.clear();
  }

  template <class Use>
  void for_each_part(std::uint64_t first, std::vector<Record>& part, const Use& use) {
    flush();
    for (std::uint64_t begin = first; begin < written_; begin += part.size()) {
      part.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kTail, written_ - begin)));
      file_.read(begin * sizeof(Record), part.data(), part.size() * sizeof(Record));
      use(begin);
    }
  }

  ScratchFile file_;
  std::uint64_t written_ = 0;
  std::vector<Record> tail_;
  mutable std::vector<Slot> slots_;
};

}  // namespace tileflight::mesh_files
