#include "region_options.h"

#include <limits>

#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/tileset/region_file.h"

namespace tileflight::app {
namespace {

geometry::Geodetic geodetic(const std::vector<double>& numbers) {
  // A missing height defaults to the centre of the tileset (tiles/tileset/load.h).
  const double height_m = numbers.size() > 2 ? numbers[2] : std::numeric_limits<double>::quiet_NaN();
  return {numbers.at(0), numbers.at(1), geometry::EllipsoidalHeight{height_m}};
}

geometry::Vec3 vec3(const std::vector<double>& numbers) { return {numbers.at(0), numbers.at(1), numbers.at(2)}; }

}  // namespace

void add_region_options(CLI::App& command, RegionOptions& options) {
  auto* center = command
                     .add_option("--center", options.center,
                                 "LAT,LON[,HEIGHT] of the region's centre, degrees and metres above the ellipsoid")
                     ->delimiter(',')
                     ->expected(2, 3);
  auto* local = command
                    .add_option("--center-local", options.center_local,
                                "X,Y,Z of the region's centre in the tileset's own frame, metres")
                    ->delimiter(',')
                    ->expected(3)
                    ->excludes(center);
  command.add_option("--size", options.size, "EAST,NORTH,UP of the region, metres")->delimiter(',')->expected(3);
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

}  // namespace tileflight::app
