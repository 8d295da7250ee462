#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "tileflight/capture/preview/sample_pictures.h"

namespace tileflight::preview {

/// The pictures' cost extrapolated to the whole flight: `cost` of preview.json. Tiles and bytes of the cuts are exact.
nlohmann::json estimate_cost(PreviewedFlight& flight, const std::vector<SamplePicture>& pictures);

}  // namespace tileflight::preview
