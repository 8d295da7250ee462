#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "tileflight/tiles/http_options.h"
#include "tileflight/tiles/tile_source.h"

namespace tileflight::tiles {

/// How a source is opened; what does not concern its kind is not heeded.
struct SourceOptions {
  HttpSourceOptions http;
  std::vector<std::string> headers;  ///< "Name: value", sent to the tileset's own origin alone
  std::filesystem::path cache;       ///< folder of the cache; empty: none
  /// The user has named the folder: a provider whose terms forbid a cache is refused instead of going on without.
  bool cache_asked_for = false;
  std::uintmax_t cache_bytes = std::uintmax_t{4} << 30;
  /// The user states that their agreement with the provider allows what its public terms forbid.
  bool terms_accepted = false;

  std::string google_key;
  std::string google_root = "https://tile.googleapis.com/v1/3dtiles/root.json";
  std::string ion_token;
  std::string ion_api = "https://api.cesium.com";
};

/// What a user writes as SOURCE: a tileset.json, its folder, a .3tz or a .3dtiles (told apart by their first bytes), or
/// an http or https URL of a tileset.json (one that ends in a slash is its folder). Throws InputError when it is none
/// of them.
std::unique_ptr<TileSource> open_source(const std::string& source, const SourceOptions& options = {});

/// Whether SOURCE is fetched from a server: a URL, `google`, `ion:ASSET`.
bool is_network_source(const std::string& source);

/// What a SOURCE that is no server's lies in: an archive, or the folder of a tileset.json, which holds all its files.
/// Empty for a server's, and where there is nothing.
std::filesystem::path files_of_source(const std::string& source);

/// SOURCE as it may stand in a message or a result: keys and tokens in a URL are hidden.
std::string shown_source(const std::string& source);

}  // namespace tileflight::tiles
