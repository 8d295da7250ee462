#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "command.h"
#include "region_options.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::app {

/// Options of `inspect` that read the tiles' content.
struct InspectPlaceOptions {
  RegionOptions region;
  std::string map;  ///< image to write; empty: none
  int pixels = 1100;
  double memory_gb = 0.0;
  std::vector<std::string> at, at_local;  ///< points whose heights are queried
};

void add_inspect_place_options(CLI::App& command, InspectPlaceOptions& options);
/// Throws InputError for options that cannot be combined.
void check_inspect_place(const CLI::App& command, const InspectPlaceOptions& options);

/// Whether the whole tree is traversed as well: not if only heights are queried, nor for the map of a place on a
/// server, whose tree may be unbounded.
bool tells_whole_tileset(const InspectPlaceOptions& options, const std::string& source);

/// Adds the results for the map and the points.
void inspect_place(const std::string& source, const fetch::SourceOptions& source_options, const CLI::App& command,
                   const InspectPlaceOptions& options, Output& output, const Progress& progress);

}  // namespace tileflight::app
