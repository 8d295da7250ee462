#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "region_options.h"
#include "tileflight/tiles/open_source.h"

namespace tileflight::app {

/// What `inspect` looks at in the tiles themselves.
struct InspectPlaceOptions {
  RegionOptions region;
  std::string map;  ///< picture to write; empty: none
  int pixels = 1100;
  double memory_gb = 0.0;
  std::vector<std::string> at, at_local;  ///< points whose heights are asked for
};

void add_inspect_place_options(CLI::App& command, InspectPlaceOptions& options);
/// Throws InputError for options that are of no use together.
void check_inspect_place(const CLI::App& command, const InspectPlaceOptions& options);

/// Whether the whole tree is looked through as well: not where only heights are asked for, nor for the map of a place
/// on a server, whose tree may have no end.
bool tells_whole_tileset(const InspectPlaceOptions& options, const std::string& source);

/// Adds the map's and the points' answers.
void inspect_place(const std::string& source, const tiles::SourceOptions& source_options, const CLI::App& command,
                   const InspectPlaceOptions& options, Output& output, const Progress& progress);

}  // namespace tileflight::app
