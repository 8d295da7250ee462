#include "tileflight/tiles/fetch/tile_source.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/decompress.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

namespace fs = std::filesystem;

/// A file name as the last segment of a URI: special characters are escaped.
std::string escaped(const std::string& name) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string out;
  for (const char c : name) {
    if (std::string_view("%?#\\").find(c) != std::string_view::npos) {
      const auto byte = static_cast<unsigned char>(c);
      out += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    } else {
      out += c;
    }
  }
  return out;
}

bool leaves_folder(const fs::path& relative) {
  return relative.is_absolute() ||
         std::any_of(relative.begin(), relative.end(), [](const fs::path& segment) { return segment == ".."; });
}

}  // namespace

FolderSource::FolderSource(const fs::path& tileset_json, const FolderSourceOptions& options)
    : folder_(tileset_json.parent_path()),
      root_uri_("./" + escaped(tileset_json.filename().string())),
      options_(options) {
  root_uri_ = resolve_uri("", root_uri_);
  if (!fs::is_regular_file(tileset_json)) throw InputError(tileset_json.string(), "is not a file");
}

fs::path FolderSource::file_of(const std::string& uri) const {
  const std::string shown = uri_for_message(uri);
  const std::string scheme = uri_scheme(uri);
  if (!scheme.empty() && !(scheme == "file" && options_.allow_outside_folder)) {
    throw InputError(shown, "a tileset in a folder may refer only to files in it, not to a URI with '" + scheme + ":'");
  }
  const std::string path = uri_path(uri);
  if (uri.starts_with("//"))
    throw InputError(shown, "a tileset in a folder may refer only to files in it, not to another host");
  if (!options_.allow_outside_folder && leaves_folder(path)) {
    throw InputError(shown,
                     "refers to a file outside the tileset's folder, " + folder_.string() + ", which is not allowed");
  }
  return folder_ / path;
}

std::vector<std::byte> FolderSource::read(const std::string& uri) {
  const fs::path file = file_of(uri);
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (!fs::exists(status)) throw InputError(uri_for_message(uri), "is missing (no file " + file.string() + ")");
  // A device or pipe could block or never end.
  if (!fs::is_regular_file(status))
    throw InputError(uri_for_message(uri), "is not a regular file (" + file.string() + ")");
  return base::read_bytes(file, options_.max_file_bytes);
}

std::optional<std::uintmax_t> FolderSource::size(const std::string& uri) {
  try {
    const fs::path file = file_of(uri);
    std::error_code error;
    if (!fs::is_regular_file(file, error)) return std::nullopt;
    const std::uintmax_t bytes = fs::file_size(file, error);
    return error ? std::nullopt : std::optional(bytes);
  } catch (const InputError&) {
    return std::nullopt;  // a path that may not be read has no size
  }
}

std::vector<std::byte> CountingSource::read(const std::string& uri) {
  std::vector<std::byte> bytes = inner_.read(uri);
  CountedFile file{remove_secrets(uri), static_cast<std::int64_t>(bytes.size())};
  const std::lock_guard lock(mutex_);
  if (!read_.insert(file.uri).second) return bytes;
  bytes_ += file.bytes;
  new_files_.push_back(std::move(file));
  return bytes;
}

std::int64_t CountingSource::bytes() const {
  const std::lock_guard lock(mutex_);
  return bytes_;
}

std::vector<CountedFile> CountingSource::take_new_files() {
  const std::lock_guard lock(mutex_);
  return std::exchange(new_files_, {});
}

void CountingSource::count(const CountedFile& file) {
  const std::lock_guard lock(mutex_);
  if (read_.insert(file.uri).second) bytes_ += file.bytes;
}

std::string resolve_reference(const TileSource& source, const std::string& file_uri, std::string_view reference) {
  return resolve_in_tileset(source.base_uri(file_uri), reference);
}

std::vector<std::byte> read_uri(TileSource& source, const std::string& uri) {
  constexpr std::size_t kMostUnpacked = std::size_t{1} << 30;
  std::vector<std::byte> bytes = is_data_uri(uri) ? decode_data_uri(uri, uri_for_message(uri)) : source.read(uri);
  return base::is_gzip(bytes) ? base::gunzip(bytes, kMostUnpacked, uri_for_message(uri)) : std::move(bytes);
}

}  // namespace tileflight::fetch
