#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tileflight/capture/render/orthophoto.h"
#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/tiles/tileset/load.h"

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

/// Input and resolution of `tileflight inspect --map`.
struct InspectMapSettings {
  std::string source;                              ///< SOURCE of the contract
  tileset::LoadOptions load;                       ///< region and origin; its geometric error is ignored
  std::optional<double> error_m;                   ///< requested geometric error; default: the size of a pixel
  int longer_side_px = 1100;                       ///< pixels along the ground's longer side
  std::optional<std::uintmax_t> max_memory_bytes;  ///< default: half of the machine's memory
};

/// Draws the place from above with its heights (core/drawing/place_map.h) into a .png or .jpg, and proposes a suitable
/// region and voxel size. Without a region, the whole place is drawn, cropped to its surface. Tiles are read part by
/// part, at the resolution of a pixel; missing or broken tiles are marked and reported. Returns `map`, `frame`,
/// `georeferenced`, `proposal`, `attribution`, `warnings`. Throws InputError.
nlohmann::json inspect_map(const InspectMapSettings& settings, const std::filesystem::path& picture,
                           const Progress& progress = {});

/// Writes a readable summary of `found`, the result of inspect_map(), one line per item.
std::string inspect_map_text(const nlohmann::json& found);

}  // namespace tileflight::preview
