#pragma once

#include <cstdint>
#include <filesystem>

#include "tileflight/geometry/geodesy.h"
#include "tileflight/geometry/output_folder.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::tiling {

/// The built-in place at the paper's coordinates.
inline constexpr double kStadiumLatitudeDeg = 35.310344;
inline constexpr double kStadiumLongitudeDeg = -80.740007;
inline constexpr double kStadiumHeightM = 190.0;  ///< ellipsoidal height of the field, metres

struct StadiumOptions {
  std::uint64_t seed = 1;
  double texture_scale = 1.0;  ///< 1: full texture resolution; tests use less
};

/// What a folder of write_stadium() holds that was written before folders had a marker.
geometry::UnmarkedFolder unmarked_stadium();

/// Writes OUT/twin/tileset.json and OUT/world/tileset.json (3D Tiles 1.1, glb, JPEG, several levels of detail, ECEF).
/// `world` is fine; `twin` is what photogrammetry would keep of it: simplified, slightly noisy, blurred textures. Same
/// seed, same bytes.
void write_stadium(const std::filesystem::path& folder, const StadiumOptions& options, const Progress& progress = {});

}  // namespace tileflight::tiling
