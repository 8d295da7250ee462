#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/core/geometry/point_cloud.h"
#include "tileflight/tiles/tileset/region.h"
#include "tileflight/world/ground_truth/quantization_floor.h"

namespace tileflight::place {

/// Region over which a map is scored: a box of the local frame, or the polygons in it.
struct TruthRegion {
  geometry::Box3 box;
  std::vector<geometry::PolygonArea> polygons;

  bool contains_horizontally(const geometry::Vec3& p) const;
};

/// Returns the points over the scored region; there is no ground truth outside it.
geometry::PointCloud crop_to_region(const geometry::PointCloud& cloud, const TruthRegion& region);

/// Wall-clock times of an extraction.
struct ExtractTimes {
  double load_s = 0.0;   ///< reading tiles
  double truth_s = 0.0;  ///< everything else
  double total_s = 0.0;
};

/// Result of extract(): the content of extract.json (docs/formats.md), which lies beside the ground truth.
struct ExtractResult {
  std::string source{};           ///< in the form in which it may be displayed
  std::int64_t tiles_wanted = 0;  ///< contents of the cut, and parts of the tree that could not be followed
  std::int64_t tiles_loaded = 0;
  std::int64_t tiles_failed = 0;
  std::vector<std::string> failures{};  ///< one line for each failed tile
  bool complete = true;                 ///< every tile was loaded that the region needs at the requested error
  double geometric_error_wanted_m = 0.0;
  std::optional<double> geometric_error_max_m{};  ///< largest geometric error in the cut; nullopt: not finite
  std::int64_t triangles = 0;                     ///< in the region
  std::int64_t triangles_loaded = 0;
  std::int64_t points = 0;  ///< points of point clouds in the region
  std::int64_t bytes_read = 0;
  std::string cut_sha256{};                  ///< identifies the exact set of tiles
  double voxel_m = 0.0;                      ///< edge of a voxel
  std::array<std::int32_t, 3> voxel_dims{};  ///< cells east, north, up
  std::int64_t voxels_occupied = 0;
  std::int64_t surface_points = 0;             ///< samples of the surface
  std::optional<tileset::Region> region{};     ///< local frame; nullopt: the file does not state it
  std::optional<geometry::Geodetic> origin{};  ///< of the local frame; nullopt: the place is not georeferenced
  std::vector<std::string> attribution{};
  std::string terms_provider{}, terms_url{};
  bool terms_accepted = false;
  std::vector<std::string> warnings{};
  std::string version{};  ///< of the program
  ExtractTimes seconds{};
  /// Errors of a perfect map, stored so that no evaluation needs to read the samples again; nullopt: no cell is
  /// occupied.
  std::optional<ground_truth::FloorStatistics> quantization_floor{};

  /// Returns the region over which maps are scored. Throws InputError if the file does not state it.
  TruthRegion scored_region() const;
};

/// Converts a result to the JSON of extract.json.
nlohmann::json to_json(const ExtractResult& result);

/// Writes extract.json into an existing folder. Throws InputError.
void write_extract_json(const ExtractResult& result, const std::filesystem::path& folder);

/// Reads extract.json of a folder written by extract(). Missing keys keep the defaults. Throws InputError (file, cause)
/// for a file that is not a JSON object, or a value of another type.
ExtractResult read_extract_json(const std::filesystem::path& folder);

/// Converts a region to {center, size} and, if polygons bound it, their rings; metres in the local frame.
nlohmann::json region_json(const tileset::Region& region);

/// Converts the local frame's origin to {origin_lat, origin_lon (degrees), origin_height (metres above the ellipsoid)};
/// nulls without a frame.
nlohmann::json frame_json(const std::optional<geometry::Geodetic>& origin);
nlohmann::json frame_json(const std::optional<geometry::LocalFrame>& frame);

/// Returns the entries of dataset.yaml that describe the local frame: `frame.kind` is east-north-up with
/// `frame.origin_lat`, `origin_lon` (degrees) and `origin_height` (metres above the ellipsoid), or tileset: its own
/// z-up frame.
std::map<std::string, std::string> describe_frame(const std::optional<geometry::Geodetic>& origin);

}  // namespace tileflight::place
