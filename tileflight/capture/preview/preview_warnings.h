#pragma once

#include <string>
#include <vector>

#include "tileflight/capture/preview/sample_pictures.h"

namespace tileflight::preview {

/// All that a preview warns of: a flight beside the place, its `faults`, too little parallax at the start, coarser
/// tiles than the flight's (`checked_coarser`: those of the checks), tiles that could not be read (`missing`; each
/// once), and what the place's reader says.
std::vector<std::string> collect_warnings(const PreviewedFlight& flight, const FlightCheck& check,
                                          const std::vector<render::FlightFault>& faults,
                                          const std::vector<SamplePicture>& pictures, bool checked_coarser,
                                          const std::vector<place::MissingTile>& missing);

}  // namespace tileflight::preview
