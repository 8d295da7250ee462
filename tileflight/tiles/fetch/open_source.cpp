#include "tileflight/tiles/fetch/open_source.h"

#include <filesystem>
#include <fstream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/fetch/archive_source.h"
#include "tileflight/tiles/fetch/http_source.h"
#include "tileflight/tiles/fetch/provider_google.h"
#include "tileflight/tiles/fetch/provider_ion.h"
#include "tileflight/tiles/fetch/provider_s3.h"
#include "tileflight/tiles/fetch/uri.h"
#include "tileflight/tiles/fetch/url_secrets.h"

namespace tileflight::fetch {
namespace {

namespace fs = std::filesystem;

bool is_url(const std::string& source) {
  const std::string scheme = uri_scheme(source);
  return scheme == "http" || scheme == "https";
}

std::string first_bytes(const fs::path& file) {
  std::string start(16, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(stream.gcount()));
  return start;
}

/// nullptr: no cache. If the user did not name the folder, failure to open it is not an error.
std::unique_ptr<HttpCache> open_cache(const SourceOptions& options) {
  if (options.cache_folder.empty()) return nullptr;
  try {
    return std::make_unique<HttpCache>(options.cache_folder, HttpCacheOptions{.max_bytes = options.cache_max_bytes});
  } catch (const InputError&) {
    if (options.cache_required) throw;
    return nullptr;
  }
}

std::unique_ptr<TileSource> open_provider(std::unique_ptr<HttpProvider> provider, const std::string& name,
                                          const SourceOptions& options) {
  std::unique_ptr<HttpCache> cache = open_cache(options);
  auto source =
      std::make_unique<HttpSource>(std::move(provider), options.http, std::move(cache), options.terms_accepted);
  if (options.cache_required) {
    require_permitted(source->terms(), Use::kCache, options.terms_accepted, redact_source(name));
  }
  return source;
}

/// Throws InputError for an archive that cannot be read in ranges.
bool is_remote_archive(const std::string& source) {
  const std::string ending = uri_extension(source);
  if (ending == "3dtiles")
    throw InputError(uri_for_message(source), "a .3dtiles is not read over HTTP: download it first");
  return ending == "3tz";
}

std::unique_ptr<TileSource> open_archive(std::unique_ptr<HttpProvider> provider, const std::string& name,
                                         const SourceOptions& options) {
  if (options.cache_required)
    throw InputError("--cache",
                     "ranges of " + redact_source(name) + " are not cached: download it, or leave out --cache");
  return std::make_unique<RemoteArchiveSource>(std::move(provider), options.http);
}

bool is_s3(const std::string& source) { return uri_scheme(source) == "s3"; }

std::unique_ptr<TileSource> open_url(const std::string& source, const SourceOptions& options) {
  if (is_remote_archive(source))
    return open_archive(std::make_unique<UrlProvider>(source, options.headers), source, options);
  const bool is_folder = source.ends_with('/');
  return open_provider(std::make_unique<UrlProvider>(is_folder ? source + "tileset.json" : source, options.headers),
                       source, options);
}

std::unique_ptr<TileSource> open_s3(const std::string& source, const SourceOptions& options) {
  if (!options.headers.empty())
    throw InputError("--header", "is not sent to " + source + ": its requests are signed with AWS_ACCESS_KEY_ID");
  auto provider = std::make_unique<S3Provider>(source, options.s3);
  if (is_remote_archive(source)) return open_archive(std::move(provider), source, options);
  return open_provider(std::move(provider), source, options);
}

GoogleOptions google_options(const SourceOptions& options) {
  GoogleOptions google;
  google.root_url = options.google_root_url;
  google.key = options.google_key;
  return google;
}

bool is_mesh(const fs::path& file, const std::string& start) {
  const std::string ending = uri_extension(file.filename().string());
  return start.starts_with("glTF") || start.starts_with("ply\n") || start.starts_with("ply\r") || ending == "obj" ||
         ending == "gltf";
}

enum class FileKind { kFolder, kTileset, kSqlite, kZip };

/// `path` must exist.
FileKind kind_of(const fs::path& path) {
  if (fs::is_directory(path)) return FileKind::kFolder;
  const std::string start = first_bytes(path);
  if (start.starts_with("SQLite format 3")) return FileKind::kSqlite;
  if (start.starts_with("PK") || uri_extension(path.filename().string()) == "3tz") return FileKind::kZip;
  return FileKind::kTileset;
}

std::unique_ptr<TileSource> open_file(const std::string& source) {
  const fs::path path(source);
  if (!fs::exists(path)) throw InputError(source, "no such file or folder");
  if (fs::is_regular_file(path) && is_mesh(path, first_bytes(path)))
    throw InputError(source, "is a mesh, not a tileset; convert it with `tileflight tile`");
  switch (kind_of(path)) {
    case FileKind::kSqlite:
      return std::make_unique<SqliteSource>(path);
    case FileKind::kZip:
      return std::make_unique<ZipSource>(path);
    case FileKind::kTileset:
      return std::make_unique<FolderSource>(path);
    case FileKind::kFolder:
      break;
  }
  if (!fs::exists(path / "tileset.json")) throw InputError(source, "the folder has no tileset.json");
  return std::make_unique<FolderSource>(path / "tileset.json");
}

}  // namespace

bool is_network_source(const std::string& source) {
  return is_url(source) || is_s3(source) || source == "google" || uri_scheme(source) == "ion";
}

fs::path local_path_of_source(const std::string& source) {
  const fs::path path(source);
  std::error_code error;
  if (is_network_source(source) || !fs::exists(path, error)) return {};
  if (kind_of(path) != FileKind::kTileset) return path;
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

std::string redact_source(const std::string& source) { return is_url(source) ? redact_url(source) : source; }

std::unique_ptr<TileSource> open_source(const std::string& source, const SourceOptions& options) {
  if (is_url(source)) return open_url(source, options);
  if (is_s3(source)) return open_s3(source, options);
  if (source == "google") {
    return open_provider(std::make_unique<GoogleProvider>(google_options(options)), source, options);
  }
  if (uri_scheme(source) == "ion") {
    const IonOptions ion{options.ion_api_url, source.substr(4), options.ion_token, google_options(options)};
    return open_provider(std::make_unique<IonProvider>(ion), source, options);
  }
  return open_file(source);
}

}  // namespace tileflight::fetch
