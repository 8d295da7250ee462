#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

namespace tileflight::mesh_files {

/// A file that is mapped into memory: its bytes are read when they are used, so that a large file can be parsed without
/// being held.
class MappedFile {
 public:
  /// Throws InputError if the file cannot be opened or is larger than `max_bytes`.
  MappedFile(const std::filesystem::path& file, std::uintmax_t max_bytes);
  ~MappedFile();
  MappedFile(const MappedFile&) = delete;
  MappedFile& operator=(const MappedFile&) = delete;

  std::string_view text() const { return {data_, size_}; }
  std::span<const std::byte> bytes() const { return std::as_bytes(std::span(data_, size_)); }

  /// Frees the memory of what was read; it is read again when it is used again.
  void release() const;

 private:
  char* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace tileflight::mesh_files
