#pragma once

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "tileflight/geometry/progress.h"
#include "tileflight/tiles/load.h"

namespace tileflight::experiment {

/// What `tileflight extract` takes of which place.
struct ExtractSettings {
  std::string source;       ///< SOURCE of the contract
  tiles::LoadOptions load;  ///< region and geometric error
  double voxel_m = 1.0;
  double samples_per_m2 = 16.0;
};

/// Reads the region's cut and writes its ground truth as a whole folder: mesh.glb, surface.ply, voxels.binvox,
/// voxels.ply, octree.bt and extract.json, whose content is returned. Throws InputError; nothing is left half written.
nlohmann::json extract(const ExtractSettings& settings, const std::filesystem::path& folder, bool replace,
                       const Progress& progress = {});

/// extract.json of a folder that extract() wrote.
nlohmann::json read_extract_json(const std::filesystem::path& folder);

/// The origin of the local frame that an extract.json names; nullopt where the place is not georeferenced.
std::optional<geometry::Geodetic> origin_of(const nlohmann::json& extract_json);

/// The lines of dataset.yaml that say what the local frame is: `frame.kind` east-north-up with `frame.origin_lat`,
/// `origin_lon` (degrees) and `origin_height` (metres above the ellipsoid), or tileset: its own z-up frame.
std::map<std::string, std::string> described_frame(const std::optional<geometry::Geodetic>& origin);

}  // namespace tileflight::experiment
