#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/tiles/tile_content/json_reader.h"
#include "tileflight/tiles/tileset/bounding_volume.h"
#include "tileflight/tiles/tileset/tileset.h"

namespace tileflight::tileset {

/// Reads a tile's or content's volume (3D Tiles 1.1, "Bounding Volumes"; the extensions for S2 cells and cylinders).
/// Returns nullopt if there is none of a known kind. Throws InputError.
std::optional<BoundingVolume> parse_volume(const tile_content::Json& parent, const std::string& where,
                                           const char* key = "boundingVolume");

/// Metadata of a tile or content that overrides its JSON (3D Metadata Semantic Reference 1.0, "Tiles" and "Contents").
struct TileSemantics {
  std::optional<BoundingVolume> bounding_volume;
  std::optional<S2Cell> s2_cell;                     ///< needs heights, of its own or of the volume that it replaces
  std::optional<double> min_height_m, max_height_m;  ///< above the ellipsoid; only for earth-fixed volumes
  std::optional<double> geometric_error_m;
  std::optional<Refine> refine;
  std::optional<std::string> uri;  ///< CONTENT_URI
  bool has_transform = false;      ///< TILE_TRANSFORM is present; it is ignored
};

/// Warning for TileSemantics::has_transform.
inline constexpr const char* kTransformWarning =
    "TILE_TRANSFORM in metadata is ignored: the transforms in the tileset's JSON are used";

/// Accessors for numbers and text by semantic; nullopt if there is no value.
struct SemanticValues {
  std::function<std::optional<std::vector<double>>(const std::string& semantic)> numbers;
  std::function<std::optional<std::string>(const std::string& semantic)> text;
};

/// Reads the semantics of a tile or content. `prefix`: "TILE" or "CONTENT". Throws InputError for invalid values.
TileSemantics read_semantics(const std::string& prefix, const SemanticValues& values, const std::string& where);

/// Returns the volume, replaced by the semantics' volume or with its heights.
BoundingVolume apply_semantics(const BoundingVolume& volume, const TileSemantics& semantics);

/// Converts the twelve numbers of a box.
OrientedBox parse_box(const std::vector<double>& numbers);
/// Converts the six numbers of a geographic region. Throws InputError.
GeographicRegion parse_region(const std::vector<double>& numbers, const std::string& where);
/// Converts the four numbers of a sphere. Throws InputError.
BoundingSphere parse_sphere(const std::vector<double>& numbers, const std::string& where);

/// Returns the minimum and maximum height of an earth-fixed volume; nullopt for other volumes.
std::optional<std::pair<double, double>> height_range(const BoundingVolume& volume);

}  // namespace tileflight::tileset
