#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tileflight::fetch {

/// Limits for an untrusted archive.
struct ZipLimits {
  std::size_t max_entries = std::size_t{1} << 24;
  std::uint64_t max_directory_bytes = std::uint64_t{2} << 30;
  std::uint64_t max_file_bytes = std::uint64_t{1} << 30;  ///< decompressed
};

/// A ZIP file (APPNOTE 6.3, with ZIP64) that holds a tileset: a .3tz ("3D Tiles Archive Format" 1.3). Entries are
/// stored, deflated or Zstandard. The ZIP directory is authoritative; the index of a .3tz is checked against it.
class ZipArchive {
 public:
  /// Returns `length` bytes from `offset`; only called for ranges inside the file. May be called from several threads
  /// at once.
  using ReadAt = std::function<std::vector<std::byte>(std::uint64_t offset, std::size_t length)>;

  /// Reads the directory. Throws InputError (name, cause).
  ZipArchive(ReadAt read_at, std::uint64_t size, const std::string& name, const ZipLimits& limits = {});

  /// Reads a whole entry and verifies its checksum. Throws InputError if it is missing, malformed or too large.
  std::vector<std::byte> read(const std::string& path) const;
  /// Returns the decompressed size of an entry; nullopt if there is no such entry.
  std::optional<std::uint64_t> size(const std::string& path) const;
  /// Returns the paths of all entries, in alphabetic order.
  std::vector<std::string> paths() const;
  /// Returns the differences between the .3tz index and the ZIP directory.
  const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  struct Entry {
    std::uint64_t header_offset = 0;
    std::uint64_t packed = 0;
    std::uint64_t unpacked = 0;
    std::uint32_t crc = 0;
    std::uint16_t method = 0;
    bool encrypted = false;
  };
  struct Directory {
    std::uint64_t entries = 0;
    std::uint64_t bytes = 0;
    std::uint64_t offset = 0;
  };

  std::vector<std::byte> bytes_at(std::uint64_t offset, std::uint64_t length, const std::string& what) const;
  Directory find_directory() const;
  Directory find_zip64_directory(std::uint64_t end_offset, const Directory& small) const;
  void read_directory(const Directory& directory);
  void check_index();
  std::vector<std::byte> packed_bytes(const std::string& path, const Entry& entry) const;

  ReadAt read_at_;
  std::uint64_t size_ = 0;
  std::string name_;
  ZipLimits limits_;
  std::map<std::string, Entry> entries_;
  std::vector<std::string> warnings_;
};

}  // namespace tileflight::fetch
