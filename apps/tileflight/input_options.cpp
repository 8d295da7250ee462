#include "input_options.h"

#include <cstdlib>
#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/tiles/tileset/region_file.h"

#ifdef TILEFLIGHT_LIVE
#include "tileflight/live/simulator/autopilot_flight.h"
#endif

namespace tileflight::app {

namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value == nullptr ? std::string() : std::string(value);
}

/// XDG Base Directory Specification: a relative path is ignored. Empty if there is no home folder either.
std::filesystem::path users_cache() {
  const std::filesystem::path folder = environment("XDG_CACHE_HOME");
  if (folder.is_absolute()) return folder / "tileflight";
  const std::filesystem::path home = environment("HOME");
  return home.is_absolute() ? home / ".cache" / "tileflight" : std::filesystem::path();
}

}  // namespace

void add_source_options(CLI::App& command, SourceArguments& arguments) {
  const std::string group = "Sources from the network";
  command
      .add_option("--header", arguments.headers,
                  "HTTP header \"Name: value\" for each request to the tileset's own host (may be repeated)")
      ->allow_extra_args(false)
      ->group(group);
  command
      .add_option("--allow-host", arguments.allowed_hosts,
                  "additional host (or host:port) that the tileset may load from (may be repeated)")
      ->allow_extra_args(false)
      ->group(group);
  auto* cache = command
                    .add_option("--cache", arguments.cache,
                                "folder of the cache (default: $XDG_CACHE_HOME/tileflight or ~/.cache/tileflight)")
                    ->group(group);
  command.add_option("--cache-size", arguments.cache_gb, "maximum size of the cache, GB (default 4)")
      ->check(CLI::PositiveNumber)
      ->group(group);
  command.add_flag("--no-cache", arguments.no_cache, "do not cache on disk")->excludes(cache)->group(group);
  command
      .add_flag(
          "--terms-accepted", arguments.terms_accepted,
          "declare that your agreement with the provider allows what its public terms forbid (recorded in the result)")
      ->group(group);
}

fetch::SourceOptions source_options(const SourceArguments& arguments) {
  fetch::SourceOptions options;
  options.headers = arguments.headers;
  options.http.allowed_hosts = arguments.allowed_hosts;
  if (!arguments.no_cache)
    options.cache_folder = arguments.cache.empty() ? users_cache() : std::filesystem::path(arguments.cache);
  options.cache_required = !arguments.cache.empty();
  options.cache_max_bytes = static_cast<std::uintmax_t>(arguments.cache_gb * 1e9);
  options.terms_accepted = arguments.terms_accepted;
  options.google_key = environment("GOOGLE_MAPS_API_KEY");
  options.ion_token = environment("CESIUM_ION_TOKEN");
  const std::string region = environment("AWS_REGION");
  options.s3 = {.endpoint_url = environment("AWS_ENDPOINT_URL"),
                .region = region.empty() ? environment("AWS_DEFAULT_REGION") : region,
                .access_key_id = environment("AWS_ACCESS_KEY_ID"),
                .secret_access_key = environment("AWS_SECRET_ACCESS_KEY"),
                .session_token = environment("AWS_SESSION_TOKEN")};
  return options;
}

namespace {

geometry::Geodetic geodetic(const std::vector<double>& numbers) {
  // A missing height defaults to the centre of the tileset (tiles/tileset/load.h).
  const double height_m = numbers.size() > 2 ? numbers[2] : std::numeric_limits<double>::quiet_NaN();
  return {numbers.at(0), numbers.at(1), geometry::EllipsoidalHeight{height_m}};
}

geometry::Vec3 vec3(const std::vector<double>& numbers) { return {numbers.at(0), numbers.at(1), numbers.at(2)}; }

}  // namespace

void add_region_options(CLI::App& command, RegionOptions& options) {
  auto* center =
      command
          .add_option("--center", options.center,
                      "LAT,LON[,HEIGHT] of the region's centre, degrees and metres above the ellipsoid (needs --size)")
          ->delimiter(',')
          ->expected(2, 3);
  auto* local = command
                    .add_option("--center-local", options.center_local,
                                "X,Y,Z of the region's centre in the tileset's own frame, metres (needs --size)")
                    ->delimiter(',')
                    ->expected(3)
                    ->excludes(center);
  command
      .add_option("--size", options.size,
                  "EAST,NORTH,UP of the region, metres (required with --center and --center-local)")
      ->delimiter(',')
      ->expected(3);
  command
      .add_option("--region", options.region_files,
                  "GeoJSON file whose polygons are the region (repeated: all of them together)")
      ->allow_extra_args(false)
      ->excludes(center)
      ->excludes(local);
  command
      .add_option("--origin", options.origin,
                  "LAT,LON,HEIGHT of the local frame's origin (default: the region's centre)")
      ->delimiter(',')
      ->expected(3);
  command.add_option("--error", options.error_m, "requested geometric error, metres (0: the finest available)")
      ->check(CLI::NonNegativeNumber);
  command.add_flag("--allow-incomplete", options.allow_incomplete, "continue without tiles that are missing or broken");
}

tileset::LoadOptions load_options(const RegionOptions& options) {
  tileset::LoadOptions load;
  load.error_m = options.error_m;
  load.allow_incomplete = options.allow_incomplete;
  tileset::set_region_from_geojson({options.region_files.begin(), options.region_files.end()}, load);
  if (!options.center.empty()) load.center = geodetic(options.center);
  if (!options.center_local.empty()) load.center_local = vec3(options.center_local);
  if (!options.size.empty()) load.size = vec3(options.size);
  if (!options.origin.empty()) load.origin = geodetic(options.origin);
  const bool has_center = load.center || load.center_local;
  if (has_center && !load.size)
    throw InputError("--size", "is required with --center and --center-local: EAST,NORTH,UP in metres");
  if (load.size && !has_center) throw InputError("--size", "needs --center or --center-local");
  return load;
}

void add_map_options(CLI::App& command, MapOptions& options) {
  command.add_option("MAP", options.map, "odometry folder (map.ply with trajectory.txt), or a PLY, PCD or XYZ cloud")
      ->required();
  command.add_option("--dataset", options.dataset, "dataset folder of the flight: camera, positions, true poses");
  command.add_option("--trajectory", options.trajectory,
                     "estimated poses in the map's frame (TUM); default: those of the odometry folder");
  command.add_option("--truth-trajectory", options.truth_trajectory,
                     "true poses in the local frame (TUM file, or dataset folder)");
}

std::vector<std::filesystem::path> files_named(const MapOptions& options) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files{options.dataset, options.trajectory, options.truth_trajectory};
  const fs::path map = options.map;
  // A folder without a marker that holds another program's map may contain results of an earlier call.
  const bool is_other = fs::is_directory(map) && !base::read_folder_marker(map);
  for (const fs::path& file :
       is_other ? std::vector<fs::path>{map / "map.ply", map / "trajectory.txt"} : std::vector{map})
    files.push_back(file);
  return files;
}

scoring::MapInputs map_inputs(const MapOptions& options) {
  scoring::MapInputs inputs = scoring::find_map_inputs(options.map, options.dataset);
  if (!options.trajectory.empty()) inputs.trajectory = options.trajectory;
  if (!options.truth_trajectory.empty()) inputs.truth_trajectory = options.truth_trajectory;
  return inputs;
}

recording::AutopilotFlyer autopilot_flyer() {
#ifdef TILEFLIGHT_LIVE
  return simulator::render_autopilot_flight;
#else
  return {};
#endif
}

}  // namespace tileflight::app
