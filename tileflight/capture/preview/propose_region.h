#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tileflight/capture/render/orthophoto.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::preview {

/// A region and a voxel edge that suit a place.
struct ProposedRegion {
  geometry::Vec3 center;  ///< local frame
  geometry::Vec3 size;    ///< metres east, north, up
  double voxel_m = 1.0;
  double surface_share = 0.0;  ///< share of the place's surface (seen from above) inside it
};

/// Proposes a region from a view of a place from above: the smallest upright box around its surface without the
/// outermost half percent on each side; for a place wider than 500 m (four times the published area), the square of
/// that size that holds most of the surface, nearest to its middle. Its height range is that of the surface in it, with
/// a margin. All numbers are rounded. nullopt if there is no surface.
std::optional<ProposedRegion> propose_region(const render::GroundGrid& grid, const imaging::FloatImage& heights_m);

/// Returns the command-line options for the region: "--center 35.310344,-80.740007,199.5 --size 250,250,60 --voxel 1",
/// or with
/// --center-local if the place is not georeferenced.
std::string to_cli_options(const ProposedRegion& proposed, const std::optional<geometry::LocalFrame>& frame);
nlohmann::json to_json(const ProposedRegion& proposed, const std::optional<geometry::LocalFrame>& frame);

}  // namespace tileflight::preview
