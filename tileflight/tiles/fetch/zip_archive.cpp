#include "tileflight/tiles/fetch/zip_archive.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/hash.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"

namespace tileflight::fetch {
namespace {

using Bytes = std::span<const std::byte>;

constexpr char kIndexName[] = "@3dtilesIndex1@";
constexpr std::uint32_t kLocalHeader = 0x04034B50;
constexpr std::uint32_t kDirectoryEntry = 0x02014B50;
constexpr std::uint32_t kEnd = 0x06054B50;
constexpr std::uint32_t kEnd64 = 0x06064B50;
constexpr std::uint32_t kEnd64Locator = 0x07064B50;
constexpr std::size_t kEndBytes = 22;
constexpr std::size_t kLocatorBytes = 20;

/// Reads the fields of a ZIP64 extra, in their fixed order, for those that the entry itself has as all ones.
void apply_zip64(Bytes extra, const std::array<std::uint64_t*, 3>& fields) {
  while (extra.size() >= 4) {
    const auto id = base::read_raw<std::uint16_t>(extra, 0);
    const std::size_t length = std::min<std::size_t>(base::read_raw<std::uint16_t>(extra, 2), extra.size() - 4);
    Bytes values = extra.subspan(4, length);
    extra = extra.subspan(4 + length);
    if (id != 1) continue;
    for (std::uint64_t* field : fields) {
      if (*field != 0xFFFFFFFF || values.size() < 8) continue;
      *field = base::read_raw<std::uint64_t>(values, 0);
      values = values.subspan(8);
    }
  }
}

}  // namespace

ZipArchive::ZipArchive(ReadAt read_at, std::uint64_t size, const std::string& name, const ZipLimits& limits)
    : read_at_(std::move(read_at)), size_(size), name_(name), limits_(limits) {
  read_directory(find_directory());
  check_index();
}

std::vector<std::byte> ZipArchive::bytes_at(std::uint64_t offset, std::uint64_t length, const std::string& what) const {
  if (offset > size_ || length > size_ - offset) throw InputError(name_, what + " lies outside the archive");
  return read_at_(offset, static_cast<std::size_t>(length));
}

/// The end record is the last match; a comment of up to 65535 bytes may follow it.
ZipArchive::Directory ZipArchive::find_directory() const {
  const std::uint64_t tail_bytes = std::min<std::uint64_t>(size_, kEndBytes + 65535);
  const std::vector<std::byte> tail = bytes_at(size_ - tail_bytes, tail_bytes, "its end");
  for (std::size_t i = tail.size(); i-- > 0;) {
    const Bytes end = Bytes(tail).subspan(i);
    if (end.size() < kEndBytes || base::read_raw<std::uint32_t>(end, 0) != kEnd) continue;
    const Directory small{base::read_raw<std::uint16_t>(end, 10), base::read_raw<std::uint32_t>(end, 12),
                          base::read_raw<std::uint32_t>(end, 16)};
    return find_zip64_directory(size_ - tail_bytes + i, small);
  }
  throw InputError(name_, "is not a complete ZIP archive: it has no end record");
}

ZipArchive::Directory ZipArchive::find_zip64_directory(std::uint64_t end_offset, const Directory& small) const {
  if (end_offset < kLocatorBytes) return small;
  const std::vector<std::byte> locator = bytes_at(end_offset - kLocatorBytes, kLocatorBytes, "its end");
  if (base::read_raw<std::uint32_t>(locator, 0) != kEnd64Locator) return small;
  const std::vector<std::byte> end = bytes_at(base::read_raw<std::uint64_t>(locator, 8), 56, "its ZIP64 end record");
  if (base::read_raw<std::uint32_t>(end, 0) != kEnd64) throw InputError(name_, "its ZIP64 end record is malformed");
  return {base::read_raw<std::uint64_t>(end, 32), base::read_raw<std::uint64_t>(end, 40),
          base::read_raw<std::uint64_t>(end, 48)};
}

void ZipArchive::read_directory(const Directory& directory) {
  constexpr std::size_t kEntryBytes = 46;
  if (directory.entries > limits_.max_entries || directory.bytes > limits_.max_directory_bytes) {
    throw InputError(name_, "has more entries than the limit of " + std::to_string(limits_.max_entries));
  }
  const std::vector<std::byte> bytes = bytes_at(directory.offset, directory.bytes, "its directory");
  Bytes rest = bytes;
  for (std::uint64_t i = 0; i < directory.entries; ++i) {
    if (rest.size() < kEntryBytes || base::read_raw<std::uint32_t>(rest, 0) != kDirectoryEntry) {
      throw InputError(name_, "its directory is malformed at entry " + std::to_string(i));
    }
    const std::size_t name_bytes = base::read_raw<std::uint16_t>(rest, 28);
    const std::size_t extra_bytes = base::read_raw<std::uint16_t>(rest, 30);
    const std::size_t whole = kEntryBytes + name_bytes + extra_bytes + base::read_raw<std::uint16_t>(rest, 32);
    if (whole > rest.size()) throw InputError(name_, "its directory is truncated at entry " + std::to_string(i));
    Entry entry;
    entry.encrypted = (base::read_raw<std::uint16_t>(rest, 8) & 1U) != 0;
    entry.method = base::read_raw<std::uint16_t>(rest, 10);
    entry.crc = base::read_raw<std::uint32_t>(rest, 16);
    entry.packed = base::read_raw<std::uint32_t>(rest, 20);
    entry.unpacked = base::read_raw<std::uint32_t>(rest, 24);
    entry.header_offset = base::read_raw<std::uint32_t>(rest, 42);
    apply_zip64(rest.subspan(kEntryBytes + name_bytes, extra_bytes),
                {&entry.unpacked, &entry.packed, &entry.header_offset});
    const std::string path(reinterpret_cast<const char*>(rest.data()) + kEntryBytes, name_bytes);
    if (!entries_.emplace(path, entry).second) throw InputError(name_, "contains '" + path + "' twice");
    rest = rest.subspan(whole);
  }
}

/// "3D Tiles Archive Format", section "Index": 24 bytes an entry, MD5 of the path and offset of the local header,
/// sorted by the hash as two little-endian numbers.
void ZipArchive::check_index() {
  constexpr std::size_t kIndexEntry = 24;
  if (size(kIndexName) == std::nullopt) {
    warnings_.emplace_back("the archive has no index; its directory is used");
    return;
  }
  using Hash = std::pair<std::uint64_t, std::uint64_t>;
  const std::vector<std::byte> bytes = read(kIndexName);
  std::map<Hash, std::uint64_t> index;
  bool sorted = bytes.size() % kIndexEntry == 0;
  Hash last{0, 0};
  for (std::size_t i = 0; i + kIndexEntry <= bytes.size(); i += kIndexEntry) {
    const Hash hash{base::read_raw<std::uint64_t>(bytes, i), base::read_raw<std::uint64_t>(bytes, i + 8)};
    sorted = sorted && last <= hash;
    last = hash;
    index[hash] = base::read_raw<std::uint64_t>(bytes, i + 16);
  }
  if (!sorted) warnings_.emplace_back("the archive's index is not sorted; its directory is used");
  for (const auto& [path, entry] : entries_) {
    if (path == kIndexName || path.ends_with('/')) continue;
    const std::array<std::uint8_t, 16> digest = base::md5(path);
    Hash hash;
    std::memcpy(&hash.first, digest.data(), 8);
    std::memcpy(&hash.second, digest.data() + 8, 8);
    const auto it = index.find(hash);
    if (it != index.end() && it->second == entry.header_offset) continue;
    warnings_.emplace_back("the archive's index does not point to '" + path + "'; its directory is used");
    return;
  }
}

std::optional<std::uint64_t> ZipArchive::size(const std::string& path) const {
  const auto it = entries_.find(path);
  return it == entries_.end() ? std::nullopt : std::optional(it->second.unpacked);
}

std::vector<std::string> ZipArchive::paths() const {
  std::vector<std::string> paths;
  for (const auto& [path, entry] : entries_) paths.push_back(path);
  return paths;
}

std::vector<std::byte> ZipArchive::packed_bytes(const std::string& path, const Entry& entry) const {
  constexpr std::size_t kHeaderBytes = 30;
  const std::string what = "the entry '" + path + "'";
  const std::vector<std::byte> header = bytes_at(entry.header_offset, kHeaderBytes, what);
  if (base::read_raw<std::uint32_t>(header, 0) != kLocalHeader)
    throw InputError(name_, what + " has no header at its offset");
  const std::uint64_t name_bytes = base::read_raw<std::uint16_t>(header, 26);
  const std::vector<std::byte> name = bytes_at(entry.header_offset + kHeaderBytes, name_bytes, what);
  if (std::string_view(reinterpret_cast<const char*>(name.data()), name.size()) != path) {
    throw InputError(name_, what + " has another name in its own header");
  }
  return bytes_at(entry.header_offset + kHeaderBytes + name_bytes + base::read_raw<std::uint16_t>(header, 28),
                  entry.packed, what);
}

std::vector<std::byte> ZipArchive::read(const std::string& path) const {
  constexpr std::uint64_t kDeflateRatio = 1032;  // zlib, "Technical Details": the maximum of deflate
  const auto it = entries_.find(path);
  if (it == entries_.end()) throw InputError(path, "is missing in " + name_);
  const Entry& entry = it->second;
  const std::string where = name_ + ": " + path;
  if (entry.encrypted) throw InputError(where, "is encrypted");
  if (entry.unpacked > limits_.max_file_bytes) {
    throw InputError(where, "has " + std::to_string(entry.unpacked) + " bytes, more than the limit of " +
                                std::to_string(limits_.max_file_bytes));
  }
  std::vector<std::byte> bytes = packed_bytes(path, entry);
  if (entry.method == 0) {
    if (bytes.size() != entry.unpacked) throw InputError(where, "its two sizes differ, though it is not compressed");
  } else if (entry.method == 8) {
    if (entry.unpacked / kDeflateRatio > bytes.size()) throw InputError(where, "declares more than it can unpack to");
    bytes = base::inflate(bytes, static_cast<std::size_t>(entry.unpacked), where);
  } else if (entry.method == 93) {
    bytes = base::decompress_zstd(bytes, static_cast<std::size_t>(entry.unpacked), where);
  } else {
    throw InputError(where, "is compressed by method " + std::to_string(entry.method) +
                                "; supported are stored, deflate and Zstandard");
  }
  if (crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()) != entry.crc) {
    throw InputError(where, "is damaged: its checksum differs");
  }
  return bytes;
}

}  // namespace tileflight::fetch
