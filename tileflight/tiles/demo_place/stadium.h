#pragma once

#include <cstdint>
#include <filesystem>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"

namespace tileflight::demo_place {

/// Latitude of the built-in site. The coordinates are those of the paper.
inline constexpr double kStadiumLatitudeDeg = 35.310344;
inline constexpr double kStadiumLongitudeDeg = -80.740007;
inline constexpr double kStadiumHeightM = 190.0;  ///< ellipsoidal height of the field, metres

/// Options of the built-in site.
struct StadiumOptions {
  std::uint64_t seed = 1;
  double texture_scale = 1.0;  ///< 1: full texture resolution; tests use lower values
  bool twin = true;            ///< false: only `world` is written
};

/// Writes OUT/twin/tileset.json and OUT/world/tileset.json (3D Tiles 1.1, glb, JPEG, several levels of detail, ECEF).
/// `world` is the detailed model; `twin` simulates its photogrammetric reconstruction: simplified, slightly noisy,
/// blurred textures. The same seed gives the same bytes.
void write_stadium(const std::filesystem::path& folder, const StadiumOptions& options, const Progress& progress = {});

}  // namespace tileflight::demo_place
