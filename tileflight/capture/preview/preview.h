#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

#include "tileflight/capture/preview/sample_pictures.h"

namespace tileflight::preview {

/// Checks a flight before it is rendered. Writes into `out`, atomically:
///   map.png       path over the place, with viewing directions and the footprints of the first, middle, last image
///   profile.png   height above ground and clearance along the path; profile.csv
///   first.jpg, middle.jpg, last.jpg   these images, reduced in size, by the renderer itself
///   preview.json  all of it in numbers, the estimated cost of rendering, and warnings; it is returned
///
/// The checks use tiles with an error of at most half a percent of their distance from the path (coarser ones only for
/// lack of memory, which is reported); the images use the tiles from which the flight is rendered. The cost is
/// estimated from the three images: tiles and bytes of the cut are exact, memory and seconds approximate. Missing tiles
/// are reported as warnings. Throws InputError.
nlohmann::json preview_flight(const PreviewSettings& settings, const std::filesystem::path& out, bool replace,
                              const Progress& progress = {});

}  // namespace tileflight::preview
