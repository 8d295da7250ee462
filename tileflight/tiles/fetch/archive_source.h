#pragma once

struct sqlite3;

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/http_provider.h"
#include "tileflight/tiles/fetch/tile_source.h"
#include "tileflight/tiles/fetch/zip_archive.h"

namespace tileflight::fetch {

/// Source of the files in a .3tz on a server. It fetches only the directory and the entries that are read (HTTP range
/// requests, RFC 9110, section 14), and notices by the ETag if the file changes meanwhile. It caches nothing on disk.
/// Thread safe.
class RemoteArchiveSource : public TileSource {
 public:
  /// Reads the directory. Throws InputError if the server does not answer or does not support ranges, or if the file is
  /// not an archive or has no tileset.json.
  explicit RemoteArchiveSource(std::unique_ptr<HttpProvider> provider, const HttpSourceOptions& options = {},
                               const ZipLimits& limits = {});
  ~RemoteArchiveSource() override;

  std::string root_uri() const override { return "tileset.json"; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override;
  std::vector<std::string> attribution() const override { return provider_->attribution(); }
  TermsOfUse terms() const override { return provider_->terms(); }
  std::vector<std::string> warnings() const override { return archive_->warnings(); }

 private:
  class RangeReader;

  std::unique_ptr<HttpProvider> provider_;
  std::string name_;
  std::shared_ptr<RangeReader> file_;
  std::unique_ptr<ZipArchive> archive_;
};

/// Resolves a URI of the root tileset to a path inside the archive. Throws InputError if it leads out of the
/// archive (another scheme or host, an absolute path, "..").
std::string path_in_archive(const std::string& uri, const std::string& archive);

/// Source of the files in a .3tz: a ZIP file with tileset.json at its root.
class ZipSource : public TileSource {
 public:
  /// Reads the directory. Throws InputError if the file is unreadable, is not an archive or has no tileset.json.
  explicit ZipSource(const std::filesystem::path& file, const ZipLimits& limits = {});

  std::string root_uri() const override { return "tileset.json"; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override;
  std::vector<std::string> warnings() const override { return archive_->warnings(); }

 private:
  std::string name_;
  std::unique_ptr<ZipArchive> archive_;
};

/// Source of the files in a .3dtiles: a SQLite database with a table `media` of keys (paths) and contents (possibly
/// gzip-compressed).
class SqliteSource : public TileSource {
 public:
  /// Opens the database. Throws InputError if it is unreadable, is not a database, has no such table or no
  /// tileset.json.
  explicit SqliteSource(const std::filesystem::path& file, std::uintmax_t max_file_bytes = std::uintmax_t{1} << 30);

  std::string root_uri() const override { return "tileset.json"; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override;

 private:
  struct Close {
    void operator()(sqlite3* database) const;
  };

  void check_table();
  /// Returns the first value of the first row of a query with one text parameter; nullopt if there is no row.
  std::optional<std::vector<std::byte>> value(const char* query, const std::string& parameter);

  std::string name_;
  std::mutex mutex_;  ///< a SQLite connection serves one thread at a time
  std::unique_ptr<sqlite3, Close> database_;
};

}  // namespace tileflight::fetch
