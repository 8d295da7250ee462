#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/fetch/terms.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::place {

/// A horizontal position to query, either on the earth or in the local frame.
struct GroundQuery {
  std::optional<geometry::Geodetic> geodetic;  ///< the height is ignored
  std::optional<geometry::Vec2> local;         ///< east, north, metres

  std::string text() const;  ///< as the user wrote it
};

/// Parses "LAT,LON" or "X,Y"; `option` appears in error messages. Throws InputError.
GroundQuery parse_geodetic_query(const std::string& text, const std::string& option = "--at");
GroundQuery parse_local_query(const std::string& text, const std::string& option = "--at-local");

/// Settings of ground_heights().
struct GroundHeightsSettings {
  std::string source;         ///< folder, archive or address of the tileset, as fetch::open_source() takes it
  tileset::LoadOptions load;  ///< origin of the local frame (height: that of a region, if given)
  fetch::Use use = fetch::Use::kExtract;
};

/// Finds the surfaces above and below each point by intersecting the vertical line through it (on the earth: the
/// ellipsoid's normal) with the triangles of the finest tiles on the line; no other tile is read. With one surface,
/// lowest and highest are equal; if there are several (a bridge, a tree over the ground), all are in `surfaces`.
///
/// Per point: `lat`, `lon` (null if the place is not georeferenced), `local` [east, north], `surfaces` from the highest
/// down, `highest`, `lowest` (null: no surface), `tiles_missing` (tiles on the line that could not be read). Per
/// surface: `local_z`, `height` (above the ellipsoid) and `height_above_sea_level` (EGM96), null if unknown. Throws
/// InputError: an invalid point, a broken tile (it may hold the surface) unless `load.allow_incomplete`, LAT,LON for a
/// place that is not georeferenced.
nlohmann::json ground_heights(const GroundHeightsSettings& settings, const std::vector<GroundQuery>& points,
                              const Progress& progress = {});

/// A readable line for each point.
std::string ground_heights_text(const nlohmann::json& found);

}  // namespace tileflight::place
