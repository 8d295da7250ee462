#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "tileflight/tiles/tileset/load.h"

namespace tileflight::app {

/// REGION of the contract as command line options.
struct RegionOptions {
  std::vector<double> center;             ///< lat, lon[, height]
  std::vector<double> center_local;       ///< x, y, z
  std::vector<double> size;               ///< east, north, up
  std::vector<double> origin;             ///< lat, lon, height
  std::vector<std::string> region_files;  ///< GeoJSON
  double error_m = 0.0;
  bool allow_incomplete = false;
};

void add_region_options(CLI::App& command, RegionOptions& options);

/// Throws InputError for options that cannot be combined, or a GeoJSON file without an area.
tileset::LoadOptions load_options(const RegionOptions& options);

}  // namespace tileflight::app
