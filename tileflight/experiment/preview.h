#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/experiment/flight_check.h"
#include "tileflight/experiment/fly.h"

namespace tileflight::experiment {

struct PreviewSettings {
  RenderSettings render;  ///< the flight as it would be rendered
  FlightCheckOptions check;
  int map_pixels = 1100;    ///< of the ground, along the longer side
  int picture_width = 960;  ///< of the pictures that are written
};

/// Looks at a flight before it is rendered. Writes into `out`, whole or not at all:
///   map.png       the path over the place, with where the camera looks, and what the first, middle and last picture
///   see profile.png   height above the surface below, and distance to the nearest one, along the way; profile.csv
///   first.jpg, middle.jpg, last.jpg   those pictures, small, by the renderer itself
///   preview.json  all of it in numbers, what rendering will cost, and warnings; it is returned
///
/// The checks are made on tiles that err by at most half a percent of their distance from the path (coarser ones only
/// where memory wants them, which is said), the pictures from the tiles that the flight is rendered from. What it will
/// cost is worked out of what the three pictures took: tiles and bytes of the cut are exact, memory and seconds are
/// about. Missing tiles are warned of. Throws InputError.
nlohmann::json preview(const PreviewSettings& settings, const std::filesystem::path& out, bool replace,
                       const Progress& progress = {});

/// preview.json for people.
std::string preview_text(const nlohmann::json& found, const std::filesystem::path& out);

}  // namespace tileflight::experiment
