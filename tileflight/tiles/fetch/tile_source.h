#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "tileflight/tiles/fetch/terms.h"

namespace tileflight::fetch {

/// Source of a tileset's bytes: a folder, an archive or a network source. Injected, so that tests can simulate faults.
/// URIs are those that resolve_reference makes of `root_uri` and the references in the files.
class TileSource {
 public:
  virtual ~TileSource() = default;

  /// Returns the URI of the root tileset.json.
  virtual std::string root_uri() const = 0;
  /// Reads the whole content of a URI. May be called from several threads at once. Throws InputError (uri, cause).
  virtual std::vector<std::byte> read(const std::string& uri) = 0;
  /// Returns the URI against which the references in a file that was read are resolved: its own, or the one at which
  /// the server's redirects ended (RFC 3986, section 5.1.3).
  virtual std::string base_uri(const std::string& uri) const { return uri; }
  /// Returns the size in bytes if it is known without reading; nullopt if it is not known or the file is missing.
  virtual std::optional<std::uintmax_t> size(const std::string& uri) = 0;
  /// Returns whether `size` is known for every existing file.
  virtual bool knows_sizes() const { return true; }
  /// Announces the next reads, in order, so that a source with latency can start fetching. Replaces the list announced
  /// before; an empty list cancels it. Returns false if the source does not prefetch.
  virtual bool prefetch(const std::vector<std::string>& /*uris*/) { return false; }
  /// Returns the rights holders that the provider requires to be credited, in addition to those named by the tiles.
  virtual std::vector<std::string> attribution() const { return {}; }
  /// Returns the provider's terms of use.
  virtual TermsOfUse terms() const { return unknown_terms("files"); }
  /// Returns the problems of the source as a whole that do not prevent reading, each once.
  virtual std::vector<std::string> warnings() const { return {}; }
};

/// Limits and permissions of a folder of files.
struct FolderSourceOptions {
  /// Permits paths that leave the folder of the tileset.json ("../../secret", "/etc/passwd", "file:///…"). A tileset
  /// names its files itself and may be untrusted.
  bool allow_outside_folder = false;
  std::uintmax_t max_file_bytes = std::uintmax_t{2} << 30;
};

/// Source of the files in the folder of a tileset.json.
class FolderSource : public TileSource {
 public:
  /// `tileset_json`: the root tileset. Throws InputError if it does not exist.
  explicit FolderSource(const std::filesystem::path& tileset_json, const FolderSourceOptions& options = {});

  std::string root_uri() const override { return root_uri_; }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override;

 private:
  std::filesystem::path file_of(const std::string& uri) const;

  std::filesystem::path folder_;
  std::string root_uri_;
  FolderSourceOptions options_;
};

/// A file that was read: its URI without secrets, and its size.
struct CountedFile {
  std::string uri;
  std::int64_t bytes = 0;
};

/// Forwards to another source and counts the bytes of the files read, each file once however often it is read.
class CountingSource : public TileSource {
 public:
  explicit CountingSource(TileSource& inner) : inner_(inner) {}

  std::string root_uri() const override { return inner_.root_uri(); }
  std::vector<std::byte> read(const std::string& uri) override;
  std::string base_uri(const std::string& uri) const override { return inner_.base_uri(uri); }
  std::optional<std::uintmax_t> size(const std::string& uri) override { return inner_.size(uri); }
  bool knows_sizes() const override { return inner_.knows_sizes(); }
  bool prefetch(const std::vector<std::string>& uris) override { return inner_.prefetch(uris); }
  std::vector<std::string> attribution() const override { return inner_.attribution(); }
  TermsOfUse terms() const override { return inner_.terms(); }
  std::vector<std::string> warnings() const override { return inner_.warnings(); }

  /// Returns the size of all files read.
  std::int64_t bytes() const;
  /// Returns the files that were read for the first time since the last call.
  std::vector<CountedFile> take_new_files();
  /// Counts a file that another process has read.
  void count(const CountedFile& file);

 private:
  TileSource& inner_;
  mutable std::mutex mutex_;
  std::unordered_set<std::string> read_;  ///< URIs without secrets
  std::vector<CountedFile> new_files_;
  std::int64_t bytes_ = 0;
};

/// Reads the bytes of a URI: a "data:" URI is decoded, all others are read from the source. Gzip-compressed files (from
/// plain servers and archives) are decompressed, up to 1 GiB.
std::vector<std::byte> read_uri(TileSource& source, const std::string& uri);

/// Resolves a reference that stands in a file of the source, which has been read (`resolve_in_tileset`).
std::string resolve_reference(const TileSource& source, const std::string& file_uri, std::string_view reference);

}  // namespace tileflight::fetch
