#pragma once

#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/tiles/bounding_volume.h"
#include "tileflight/tiles/tileset.h"

namespace tileflight::tiles {

/// What metadata can say of a tile or of a content instead of its JSON (3D Metadata Semantic Reference 1.0, "Tiles" and
/// "Contents").
struct TileSemantics {
  std::optional<BoundingVolume> bounding_volume;
  std::optional<S2Cell> s2_cell;                     ///< needs heights, of its own or of the volume that it replaces
  std::optional<double> min_height_m, max_height_m;  ///< above the ellipsoid; only for earth-fixed volumes
  std::optional<double> geometric_error_m;
  std::optional<Refine> refine;
  std::optional<std::string> uri;  ///< CONTENT_URI
  bool has_transform = false;      ///< TILE_TRANSFORM, which is not heeded
};

inline constexpr const char* kTransformWarning = "TILE_TRANSFORM in metadata is not heeded: tiles stand by their JSON";

/// Numbers and text of a value by its semantic; nullopt: there is none.
struct SemanticValues {
  std::function<std::optional<std::vector<double>>(const std::string& semantic)> numbers;
  std::function<std::optional<std::string>(const std::string& semantic)> text;
};

/// `prefix`: "TILE" or "CONTENT". Throws InputError for values that cannot be meant.
TileSemantics read_semantics(const std::string& prefix, const SemanticValues& values, const std::string& where);

/// The volume with the semantics' own in its place, or with its heights.
BoundingVolume with_semantics(const BoundingVolume& volume, const TileSemantics& semantics);

/// A box of twelve numbers, a region of six, a sphere of four, as 3D Tiles writes them. Throws InputError.
OrientedBox box_of(const std::vector<double>& numbers);
GeographicRegion region_of(const std::vector<double>& numbers, const std::string& where);
BoundingSphere sphere_of(const std::vector<double>& numbers, const std::string& where);

/// The heights of an earth-fixed volume; nullopt: it is another.
std::optional<std::pair<double, double>> heights_of(const BoundingVolume& volume);

}  // namespace tileflight::tiles
