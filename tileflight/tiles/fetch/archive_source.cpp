#include "tileflight/tiles/fetch/archive_source.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/uri.h"

namespace tileflight::fetch {
namespace {

namespace fs = std::filesystem;

/// An open file that several threads can read concurrently.
class OpenFile {
 public:
  OpenFile(const fs::path& file, const std::string& name)
      : name_(name), descriptor_(open(file.c_str(), O_RDONLY | O_CLOEXEC)) {
    if (descriptor_ < 0) throw InputError(name, "cannot be opened");
  }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;
  ~OpenFile() { close(descriptor_); }

  std::vector<std::byte> read(std::uint64_t offset, std::size_t length) const {
    std::vector<std::byte> out(length);
    for (std::size_t done = 0; done < length;) {
      const ssize_t count = pread(descriptor_, out.data() + done, length - done, static_cast<off_t>(offset + done));
      if (count <= 0) throw InputError(name_, "cannot be read at byte " + std::to_string(offset + done));
      done += static_cast<std::size_t>(count);
    }
    return out;
  }

 private:
  std::string name_;
  int descriptor_;
};

/// A file name as an SQLite URI.
std::string database_uri(const fs::path& file) {
  static constexpr char kHex[] = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char c : fs::absolute(file).string()) {
    if (std::string_view("%?#").find(c) == std::string_view::npos) {
      uri += c;
    } else {
      const auto byte = static_cast<unsigned char>(c);
      uri += {'%', kHex[byte >> 4U], kHex[byte & 15U]};
    }
  }
  return uri + "?immutable=1";  // no locks, no journal file
}

struct Finalize {
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};

}  // namespace

std::string path_in_archive(const std::string& uri, const std::string& archive) {
  const std::string path = uri_path(uri);
  const bool leaves = !uri_scheme(uri).empty() || uri.starts_with("/") || path.starts_with("/") || path == ".." ||
                      path.starts_with("../") || path.find("/../") != std::string::npos || path.ends_with("/..");
  if (leaves)
    throw InputError(uri_for_message(uri),
                     "refers to a file outside the archive " + archive + ", which is not allowed");
  return path;
}

ZipSource::ZipSource(const fs::path& file, const ZipLimits& limits) : name_(file.string()) {
  auto open_file = std::make_shared<const OpenFile>(file, name_);
  const auto read_at = [open_file](std::uint64_t offset, std::size_t length) {
    return open_file->read(offset, length);
  };
  archive_ = std::make_unique<ZipArchive>(read_at, fs::file_size(file), name_, limits);
  if (!archive_->size("tileset.json")) throw InputError(name_, "the archive has no tileset.json");
}

std::vector<std::byte> ZipSource::read(const std::string& uri) { return archive_->read(path_in_archive(uri, name_)); }

std::optional<std::uintmax_t> ZipSource::size(const std::string& uri) {
  try {
    return archive_->size(path_in_archive(uri, name_));
  } catch (const InputError&) {
    return std::nullopt;  // a path that may not be read has no size
  }
}

void SqliteSource::Close::operator()(sqlite3* database) const { sqlite3_close_v2(database); }

SqliteSource::SqliteSource(const fs::path& file, std::uintmax_t max_file_bytes) : name_(file.string()) {
  sqlite3* opened = nullptr;
  const int status = sqlite3_open_v2(database_uri(file).c_str(), &opened,
                                     SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX, nullptr);
  database_.reset(opened);
  if (status != SQLITE_OK) throw InputError(name_, "cannot be opened as a SQLite database");
  // The database's schema is as untrusted as its content.
  sqlite3_limit(opened, SQLITE_LIMIT_LENGTH, static_cast<int>(std::min<std::uintmax_t>(max_file_bytes, 0x7FFFFFFF)));
  sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_VIEW, 0, nullptr);
  // A look-up takes a few hundred steps; millions indicate a malicious schema.
  sqlite3_progress_handler(
      opened, 10'000'000, [](void*) { return 1; }, nullptr);
  check_table();
}

void SqliteSource::check_table() {
  const auto sql = value("SELECT sql FROM sqlite_master WHERE type = 'table' AND name = ?1", "media");
  const std::string text = sql ? std::string(reinterpret_cast<const char*>(sql->data()), sql->size()) : "";
  if (!text.starts_with("CREATE TABLE")) throw InputError(name_, "the database has no table 'media'");
  if (!value("SELECT content FROM media WHERE key = ?1", "tileset.json")) {
    throw InputError(name_, "the archive has no tileset.json");
  }
}

std::optional<std::vector<std::byte>> SqliteSource::value(const char* query, const std::string& parameter) {
  const std::lock_guard lock(mutex_);
  const auto fail = [&]() -> InputError {
    return {name_, std::string("cannot be read: ") + sqlite3_errmsg(database_.get())};
  };
  sqlite3_stmt* prepared = nullptr;
  if (sqlite3_prepare_v2(database_.get(), query, -1, &prepared, nullptr) != SQLITE_OK) throw fail();
  const std::unique_ptr<sqlite3_stmt, Finalize> statement(prepared);
  sqlite3_bind_text(prepared, 1, parameter.data(), static_cast<int>(parameter.size()), SQLITE_TRANSIENT);
  const int status = sqlite3_step(prepared);
  if (status == SQLITE_DONE) return std::nullopt;
  if (status != SQLITE_ROW) throw fail();
  const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(prepared, 0));
  const auto bytes = static_cast<std::size_t>(sqlite3_column_bytes(prepared, 0));
  return bytes == 0 ? std::vector<std::byte>() : std::vector<std::byte>(data, data + bytes);
}

std::vector<std::byte> SqliteSource::read(const std::string& uri) {
  const std::string path = path_in_archive(uri, name_);
  auto content = value("SELECT content FROM media WHERE key = ?1", path);
  if (!content) throw InputError(uri_for_message(uri), "is missing in " + name_);
  return *std::move(content);
}

std::optional<std::uintmax_t> SqliteSource::size(const std::string& uri) {
  try {
    const auto text = value("SELECT CAST(length(CAST(content AS BLOB)) AS TEXT) FROM media WHERE key = ?1",
                            path_in_archive(uri, name_));
    if (!text) return std::nullopt;
    return std::stoull(std::string(reinterpret_cast<const char*>(text->data()), text->size()));
  } catch (const InputError&) {
    return std::nullopt;
  }
}

}  // namespace tileflight::fetch
