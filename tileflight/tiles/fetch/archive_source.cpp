#include "tileflight/tiles/fetch/archive_source.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <list>
#include <mutex>
#include <optional>
#include <utility>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/http_client.h"
#include "tileflight/tiles/fetch/origin_policy.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

/// Bytes that are fetched at once and kept: an entry's header and its data, or neighbouring small entries.
constexpr std::uint64_t kChunkBytes = std::uint64_t{256} << 10;
constexpr std::size_t kMostChunks = 64;

/// The length of the whole file in "bytes 0-0/1234"; nullopt: there is none.
std::optional<std::uint64_t> whole_length(const std::string& content_range) {
  const std::size_t slash = content_range.rfind('/');
  if (slash == std::string::npos) return std::nullopt;
  std::uint64_t length = 0;
  const char* const end = content_range.data() + content_range.size();
  const auto [last, fault] = std::from_chars(content_range.data() + slash + 1, end, length);
  return fault == std::errc() && last == end ? std::optional(length) : std::nullopt;
}

}  // namespace

/// The bytes of a file on a server.
class RemoteArchiveSource::RangeReader {
 public:
  RangeReader(HttpProvider& provider, const HttpSourceOptions& options)
      : provider_(provider),
        client_(options.http),
        url_(resolve_uri("", provider.resolve_root_url(client_))),
        policy_(url_, options.allowed_hosts) {
    const HttpResponse first = ask(0, 1);
    const std::optional<std::uint64_t> length = whole_length(first.header("content-range"));
    if (!length) throw InputError(name(), "the server does not say how long the file is: download it first");
    length_ = *length;
    if (const std::string tag = first.header("etag"); tag.starts_with('"')) tag_ = tag;
  }

  std::string name() const { return uri_for_message(url_); }
  std::uint64_t length() const { return length_; }

  std::vector<std::byte> read(std::uint64_t offset, std::size_t bytes) {
    if (bytes > kChunkBytes) return ask(offset, bytes).body;
    std::vector<std::byte> out;
    while (out.size() < bytes) {
      const std::uint64_t at = offset + out.size();
      const std::shared_ptr<const std::vector<std::byte>> chunk = chunk_at(at / kChunkBytes);
      const std::uint64_t begin = at % kChunkBytes;
      const std::uint64_t count = std::min<std::uint64_t>(bytes - out.size(), chunk->size() - begin);
      const auto first = chunk->begin() + static_cast<std::ptrdiff_t>(begin);
      out.insert(out.end(), first, first + static_cast<std::ptrdiff_t>(count));
    }
    return out;
  }

 private:
  using Chunk = std::shared_ptr<const std::vector<std::byte>>;

  /// The latest chunks are kept.
  Chunk chunk_at(std::uint64_t index) {
    {
      const std::lock_guard lock(mutex_);
      const auto kept = std::ranges::find(chunks_, index, &std::pair<std::uint64_t, Chunk>::first);
      if (kept != chunks_.end()) {
        chunks_.splice(chunks_.begin(), chunks_, kept);
        return kept->second;
      }
    }
    const std::uint64_t begin = index * kChunkBytes;
    auto chunk =
        std::make_shared<const std::vector<std::byte>>(ask(begin, std::min(kChunkBytes, length_ - begin)).body);
    const std::lock_guard lock(mutex_);
    chunks_.emplace_front(index, chunk);
    if (chunks_.size() > kMostChunks) chunks_.pop_back();
    return chunk;
  }

  HttpResponse ask(std::uint64_t offset, std::uint64_t bytes) {
    HttpRequest request = provider_.make_request(url_);
    request.headers_for_redirect = [this, headers = request.headers](const std::string& target) {
      policy_.check(target);
      return policy_.is_same_origin(target) ? headers : std::vector<std::string>();
    };
    request.headers.push_back("Range: bytes=" + std::to_string(offset) + "-" + std::to_string(offset + bytes - 1));
    request.headers.emplace_back("Accept-Encoding: identity");
    if (!tag_.empty()) request.headers.push_back("If-Match: " + tag_);
    HttpResponse response = client_.get(std::move(request));
    require_range(response, bytes);
    return response;
  }

  void require_range(const HttpResponse& response, std::uint64_t bytes) const {
    if (response.status == 412 ||
        (response.status == 206 && whole_length(response.header("content-range")) != length_ && length_ > 0))
      throw InputError(name(), "has changed while it was being read: run the command again");
    if (response.status == 200)
      throw InputError(name(), "the server sends only the whole file, no ranges of it: download it first");
    if (response.status != 206) {
      throw InputError(name(), mask_secrets("the server answered with status " + std::to_string(response.status),
                                            provider_.secrets()));
    }
    if (response.body.size() != bytes)
      throw InputError(name(), "the server sent " + std::to_string(response.body.size()) + " bytes instead of the " +
                                   std::to_string(bytes) + " asked for");
  }

  HttpProvider& provider_;
  HttpClient client_;
  std::string url_;
  OriginPolicy policy_;
  std::uint64_t length_ = 0;
  std::string tag_;  ///< strong ETag; empty: none
  std::mutex mutex_;
  std::list<std::pair<std::uint64_t, Chunk>> chunks_;  ///< latest first
};

RemoteArchiveSource::RemoteArchiveSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options,
                                         const ZipLimits& limits)
    : provider_(std::move(provider)), file_(std::make_shared<RangeReader>(*provider_, options)) {
  name_ = file_->name();
  const auto read_at = [file = file_](std::uint64_t offset, std::size_t length) { return file->read(offset, length); };
  archive_ = std::make_unique<ZipArchive>(read_at, file_->length(), name_, limits);
  if (!archive_->size("tileset.json")) throw InputError(name_, "the archive has no tileset.json");
}

RemoteArchiveSource::~RemoteArchiveSource() = default;

std::vector<std::byte> RemoteArchiveSource::read(const std::string& uri) {
  return archive_->read(path_in_archive(uri, name_));
}

std::optional<std::uintmax_t> RemoteArchiveSource::size(const std::string& uri) {
  try {
    return archive_->size(path_in_archive(uri, name_));
  } catch (const InputError&) {
    return std::nullopt;  // a path that may not be read has no size
  }
}

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
