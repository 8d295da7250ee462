#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/tiles/fetch/open_source.h"
#include "tileflight/tiles/tileset/load.h"

// Options by which several commands name their inputs: tiles (SOURCE), a region of them, and a map (MAP).

namespace tileflight::app {

/// Possible values of SOURCE, for the help of each command.
inline constexpr const char* kSourceHelp =
    "tileset.json, its folder, a .3tz or a .3dtiles, an http(s) URL, s3://BUCKET/KEY, `google`, or `ion:ASSET`";

/// Describes --epoch for commands that turn a dataset into ROS 2 messages.
inline constexpr const char* kEpochHelp =
    "seconds from 1970 to the dataset's time 0 (default: 0, or whole seconds so that no message has the time 0, which "
    "ROS takes for none)";

/// Command-line options for sources on the network.
struct SourceArguments {
  std::vector<std::string> headers;        ///< "Name: value"
  std::vector<std::string> allowed_hosts;  ///< host or host:port
  std::string cache;                       ///< folder; empty: the user's default (XDG)
  double cache_gb = 4.0;
  bool no_cache = false;
  bool terms_accepted = false;
};

void add_source_options(CLI::App& command, SourceArguments& arguments);

/// Returns source options with keys and tokens from the environment (GOOGLE_MAPS_API_KEY, CESIUM_ION_TOKEN, AWS_…).
/// The cache is in $XDG_CACHE_HOME/tileflight (~/.cache/tileflight) unless the arguments name another folder.
fetch::SourceOptions source_options(const SourceArguments& arguments);

/// Command-line options that choose a region of a tileset.
struct RegionOptions {
  std::vector<double> center;             ///< latitude and longitude, degrees[, ellipsoidal height, metres]
  std::vector<double> center_local;       ///< x, y, z in the tileset's own frame, metres
  std::vector<double> size;               ///< east, north, up, metres
  std::vector<double> origin;             ///< latitude and longitude, degrees, ellipsoidal height, metres
  std::vector<std::string> region_files;  ///< GeoJSON
  double error_m = 0.0;                   ///< requested geometric error; 0: the finest tiles
  bool allow_incomplete = false;
};

void add_region_options(CLI::App& command, RegionOptions& options);

/// Converts the options for the tileset's loader. Throws InputError for options that cannot be combined, or a GeoJSON
/// file without an area.
tileset::LoadOptions load_options(const RegionOptions& options);

/// Command-line options that name a map and the known data of its flight; an empty text: not given.
struct MapOptions {
  std::string map;
  std::string dataset;
  std::string trajectory;
  std::string truth_trajectory;
};

void add_map_options(CLI::App& command, MapOptions& options);

/// Returns the files and folders that the options name. A command must not overwrite any of them.
std::vector<std::filesystem::path> files_named(const MapOptions& options);

/// Collects the inputs from the map's and the dataset's folder. Files that the options name take precedence.
scoring::MapInputs map_inputs(const MapOptions& options);

/// Returns the function that flies the autopilots of FLIGHT files in this program's simulator. It is empty in a program
/// that was built without the wing live.
recording::AutopilotFlyer autopilot_flyer();

}  // namespace tileflight::app
