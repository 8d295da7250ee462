#pragma once

#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// What `tileflight inspect --map` shows of which place.
struct InspectMapSettings {
  std::string source;                              ///< SOURCE of the contract
  tiles::LoadOptions load;                         ///< region and origin; its geometric error is not heeded
  std::optional<double> error_m;                   ///< geometric error wanted; none: that of a pixel
  int pixels = 1100;                               ///< of the ground, along the longer side
  std::optional<std::uintmax_t> max_memory_bytes;  ///< none: half of the machine's
};

/// Draws the place from above with its heights (report/place_map.h) into a .png or .jpg, and proposes a region and a
/// voxel that suit it. Without a region: all of the place, however large, cut to what has a surface. What is drawn is
/// read part by part, as finely as a pixel shows; missing or broken tiles are marked and told. Returns what was found:
/// `map`, `frame`, `georeferenced`, `proposal`, `attribution`, `warnings`. Throws InputError.
nlohmann::json inspect_map(const InspectMapSettings& settings, const std::filesystem::path& picture,
                           const Progress& progress = {});

/// A line for each thing that `found` says, for people.
std::string inspect_map_text(const nlohmann::json& found);

}  // namespace tileflight::experiment
