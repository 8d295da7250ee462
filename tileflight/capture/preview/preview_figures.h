#pragma once

#include <string>
#include <vector>

#include "tileflight/capture/preview/sample_pictures.h"

namespace tileflight::preview {

/// Collects the warnings of a preview: a flight beside the place, its `faults`, too little parallax at the start,
/// coarser tiles than the flight's (`checked_coarser`: those of the checks), tiles that could not be read (`missing`,
/// each named once), and the warnings of the place's reader.
std::vector<std::string> collect_warnings(const PreviewedFlight& flight, const FlightCheck& check,
                                          const std::vector<render::FlightFault>& faults,
                                          const std::vector<SamplePicture>& pictures, bool checked_coarser,
                                          const std::vector<place::MissingTile>& missing);

/// Data from which the files are written.
struct PreviewFigures {
  imaging::RgbImage map, profile;
  std::string profile_csv;  ///< fields are empty where a value is unknown, or a surface beyond the search range
};

/// Draws the path over the place, and heights along it. `scene`: the tiles of the checks. Tiles of the map that could
/// not be read are appended to `missing`.
PreviewFigures draw_figures(PreviewedFlight& flight, const scene::Scene& scene, const FlightCheck& check,
                            const std::vector<SamplePicture>& pictures, std::vector<place::MissingTile>& missing,
                            const Progress& progress);

}  // namespace tileflight::preview
