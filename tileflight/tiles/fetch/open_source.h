#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/http_options.h"
#include "tileflight/tiles/fetch/tile_source.h"

namespace tileflight::fetch {

/// Options for opening a source; options that do not apply to the kind of source are ignored.
struct SourceOptions {
  HttpSourceOptions http;
  std::vector<std::string> headers;    ///< "Name: value", sent only to the tileset's own origin
  std::filesystem::path cache_folder;  ///< cache folder; empty: no cache
  /// True if the user named the folder: a provider whose terms forbid caching is then refused instead of used without a
  /// cache.
  bool cache_required = false;
  std::uintmax_t cache_max_bytes = std::uintmax_t{4} << 30;
  /// The user states that their agreement with the provider allows what its public terms forbid.
  bool terms_accepted = false;

  std::string google_key;
  std::string google_root_url = "https://tile.googleapis.com/v1/3dtiles/root.json";
  std::string ion_token;
  S3Options s3;
  std::string ion_api_url = "https://api.cesium.com";
};

/// Opens the SOURCE given by a user: a tileset.json, its folder, a .3tz or a .3dtiles (recognised by their first
/// bytes), an http or https URL of a tileset.json, of its folder (ending in a slash) or of a .3tz, one of these in an
/// object store as s3://BUCKET/KEY, `google`, or `ion:ASSET`. Throws InputError if it is none of them.
std::unique_ptr<TileSource> open_source(const std::string& source, const SourceOptions& options = {});

/// Returns whether SOURCE is fetched over the network: a URL, `s3://…`, `google`, `ion:ASSET`.
bool is_network_source(const std::string& source);

/// Returns the local file or folder of a SOURCE: the archive, or the folder of a tileset.json, which holds all its
/// files. Empty for a network source or if nothing is there.
std::filesystem::path local_path_of_source(const std::string& source);

/// Returns SOURCE for messages and results, in which keys and tokens of a URL are hidden.
std::string redact_source(const std::string& source);

}  // namespace tileflight::fetch
