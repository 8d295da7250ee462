#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// A place whose surfaces are asked for, one of: on the earth, or in the local frame.
struct GroundQuery {
  std::optional<geometry::Geodetic> geodetic;  ///< its height does not count
  std::optional<geometry::Vec2> local;         ///< east, north, metres

  std::string text() const;  ///< as it was asked
};

/// "LAT,LON" or "X,Y"; `option` stands in messages. Throws InputError.
GroundQuery geodetic_query(const std::string& text, const std::string& option = "--at");
GroundQuery local_query(const std::string& text, const std::string& option = "--at-local");

struct GroundHeightsSettings {
  std::string source;       ///< SOURCE of the contract
  tiles::LoadOptions load;  ///< origin of the local frame (and with a region, its heights); no region is needed
};

/// The surfaces over each point, by casting the vertical line through it (on the earth the ellipsoid's normal) at the
/// triangles of the finest tiles that it goes through; no other tile is read. Where there is only one, lowest and
/// highest are the same; where there are several (a bridge, a crown over the ground), all stand in `surfaces`.
///
/// Of each point: `lat`, `lon` (null where the place is not on the earth), `local` [east, north], `surfaces` from the
/// highest down, `highest`, `lowest` (null: no surface). Of each surface: `local_z`, `height` (above the ellipsoid) and
/// `height_above_sea_level` (EGM96), null where they are not known. Throws InputError: a point that is no place, a
/// broken tile (it may hold the surface), no place on the earth for LAT,LON.
nlohmann::json ground_heights(const GroundHeightsSettings& settings, const std::vector<GroundQuery>& points,
                              const Progress& progress = {});

/// A line for each point, for people.
std::string ground_heights_text(const nlohmann::json& found);

}  // namespace tileflight::experiment
