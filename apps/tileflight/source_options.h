#pragma once

#include <CLI/CLI.hpp>
#include <cstdint>
#include <string>
#include <vector>

#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::app {

/// Possible values of SOURCE, for the help of each command.
inline constexpr const char* kSourceHelp =
    "tileset.json, its folder, a .3tz or a .3dtiles, an http(s) URL, s3://BUCKET/KEY, `google`, or `ion:ASSET`";

/// Command-line options for network sources.
struct SourceArguments {
  std::vector<std::string> headers;        ///< "Name: value"
  std::vector<std::string> allowed_hosts;  ///< host or host:port
  std::string cache;                       ///< folder; empty: the user's default (XDG)
  double cache_gb = 4.0;
  bool no_cache = false;
  bool terms_accepted = false;
};

void add_source_options(CLI::App& command, SourceArguments& arguments);

/// Source options with keys and tokens from the environment (GOOGLE_MAPS_API_KEY, CESIUM_ION_TOKEN, AWS_…), and the
/// cache in $XDG_CACHE_HOME/tileflight (~/.cache/tileflight) unless another folder is given.
fetch::SourceOptions source_options(const SourceArguments& arguments);

}  // namespace tileflight::app
