#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "tileflight/core/base/progress.h"
#include "tileflight/tiles/tileset/load.h"

namespace tileflight::preview {

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
