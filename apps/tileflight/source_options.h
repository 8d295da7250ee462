#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/tiles/open_source.h"

namespace tileflight::app {

/// What SOURCE may be, as the help of each command says it.
inline constexpr const char* kSourceHelp =
    "tileset.json, its folder, a .3tz or a .3dtiles, an http(s) URL, `google`, or `ion:ASSET`";

/// How a source from the network is opened, as command line options.
struct SourceArguments {
  std::vector<std::string> headers;        ///< "Name: value"
  std::vector<std::string> allowed_hosts;  ///< host or host:port
  std::string cache;                       ///< folder; empty: the user's own (XDG)
  double cache_gb = 4.0;
  bool no_cache = false;
  bool terms_accepted = false;
};

void add_source_options(CLI::App& command, SourceArguments& arguments);

/// With keys and tokens from the environment (GOOGLE_MAPS_API_KEY, CESIUM_ION_TOKEN), and the cache in
/// $XDG_CACHE_HOME/tileflight (~/.cache/tileflight) unless another folder is named.
tiles::SourceOptions source_options(const SourceArguments& arguments);

}  // namespace tileflight::app
