#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/tiles/terms.h"

namespace tileflight::tiles {

/// Where the bytes of a tileset come from. Injected, so that a test can stage a fault: a folder, an archive, or
/// whatever fetches. URIs are those that resolve_uri makes of `root_uri` and the references in the files.
class TileSource {
 public:
  virtual ~TileSource() = default;

  /// URI of the tileset.json that everything starts from.
  virtual std::string root_uri() const = 0;
  /// The whole content behind a URI. May be called from several threads at once. Throws InputError (uri, cause).
  virtual std::vector<std::byte> read(const std::string& uri) = 0;
  /// Size in bytes, where the source can tell it without reading; nullopt: not known, or not there.
  virtual std::optional<std::uintmax_t> size(const std::string& uri) = 0;
  /// Whether `size` tells of every file that is there.
  virtual bool knows_sizes() const { return true; }
  /// Says what will be read soon, and in which order: a source for which reading means waiting begins with it. Replaces
  /// what was said before; an empty list takes it back. False: nothing was gained by saying so.
  virtual bool prefetch(const std::vector<std::string>& /*uris*/) { return false; }
  /// Holders that the provider wants to be named beside those that the tiles name.
  virtual std::vector<std::string> attribution() const { return {}; }
  /// What the provider permits.
  virtual Terms terms() const { return unknown_terms("files"); }
  /// What is wrong with the source as a whole and yet can be read; distinct.
  virtual std::vector<std::string> warnings() const { return {}; }
};

/// Limits and permissions of a folder of files.
struct FolderSourceOptions {
  /// A tileset names its files itself, and may come from anywhere: without permission no path leaves the folder of
  /// its tileset.json ("../../secret", "/etc/passwd", "file:///…").
  bool allow_outside_folder = false;
  std::uintmax_t max_file_bytes = std::uintmax_t{2} << 30;
};

/// The files below the folder of a tileset.json.
class FolderSource : public TileSource {
 public:
  /// `tileset_json`: the file that the root URI names. Throws InputError when it is not there.
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

/// Passes reads on and counts them.
class CountingSource : public TileSource {
 public:
  explicit CountingSource(TileSource& inner) : inner_(inner) {}

  std::string root_uri() const override { return inner_.root_uri(); }
  std::vector<std::byte> read(const std::string& uri) override;
  std::optional<std::uintmax_t> size(const std::string& uri) override { return inner_.size(uri); }
  bool knows_sizes() const override { return inner_.knows_sizes(); }
  bool prefetch(const std::vector<std::string>& uris) override { return inner_.prefetch(uris); }
  std::vector<std::string> attribution() const override { return inner_.attribution(); }
  Terms terms() const override { return inner_.terms(); }
  std::vector<std::string> warnings() const override { return inner_.warnings(); }

  std::int64_t bytes() const { return bytes_; }

 private:
  TileSource& inner_;
  std::atomic<std::int64_t> bytes_ = 0;
};

/// The bytes behind a URI: a "data:" URI carries them itself, all else is the source's. Files that are kept as gzip
/// (as plain servers and archives have them) are unpacked, up to 1 GiB.
std::vector<std::byte> read_uri(TileSource& source, const std::string& uri);

}  // namespace tileflight::tiles
