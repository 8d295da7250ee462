#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/sensors/top_down.h"

namespace tileflight::experiment {

/// A region and a voxel edge that suit a place.
struct ProposedRegion {
  geometry::Vec3 center;  ///< local frame
  geometry::Vec3 size;    ///< metres east, north, up
  double voxel_m = 1.0;
  double surface_share = 0.0;  ///< of the place's surface (seen from above) that lies in it
};

/// Of a place seen from above: the smallest upright box about its surface, the outermost half percent on each side left
/// out; of a place wider than 500 m (four times the published area) the square of that size which holds most of it,
/// nearest to its middle. As high as the surface in it, with a margin. Round numbers. nullopt where there is no
/// surface.
std::optional<ProposedRegion> proposed_region(const sensors::GroundGrid& grid, const imaging::FloatImage& heights_m);

/// The options that ask for it: "--center 35.310344,-80.740007,199.5 --size 250,250,60 --voxel 1", or by --center-local
/// where there is no place on the earth.
std::string options_text(const ProposedRegion& proposed, const std::optional<geometry::LocalFrame>& frame);
nlohmann::json to_json(const ProposedRegion& proposed, const std::optional<geometry::LocalFrame>& frame);

}  // namespace tileflight::experiment
