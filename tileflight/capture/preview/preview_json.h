#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/capture/preview/sample_pictures.h"

namespace tileflight::preview {

/// Extrapolates the sample images' cost to the whole flight: `cost` of preview.json. Tiles and bytes of the cuts are
/// exact.
nlohmann::json estimate_cost(PreviewedFlight& flight, const std::vector<SamplePicture>& pictures);

/// Writes a readable summary of preview.json, which is in the folder `out`.
std::string preview_text(const nlohmann::json& found, const std::filesystem::path& out);

/// Returns `nearest_surface` of preview.json; null if no surface is within the search range.
nlohmann::json nearest_surface(const FlightCheck& check, const geometry::Trajectory& frames);

/// Returns the content of preview.json (docs/formats.md).
nlohmann::json preview_json(PreviewedFlight& flight, const FlightCheck& check,
                            const std::vector<SamplePicture>& pictures, const std::vector<render::FlightFault>& faults,
                            const std::vector<std::string>& warnings);

}  // namespace tileflight::preview
