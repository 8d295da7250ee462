#pragma once

#include "tileflight/tiles/demo_place/synthetic_place.h"

namespace tileflight::demo_place {

/// Latitude of the built-in site. The coordinates are those of the paper.
inline constexpr double kStadiumLatitudeDeg = 35.310344;
inline constexpr double kStadiumLongitudeDeg = -80.740007;
inline constexpr double kStadiumHeightM = 190.0;  ///< ellipsoidal height of the field, metres

/// Makes the stadium of a seed.
SyntheticPlace make_stadium(std::uint32_t seed);

/// Writes the stadium, as write_place() does.
void write_stadium(const std::filesystem::path& folder, const PlaceOptions& options, const Progress& progress = {});

}  // namespace tileflight::demo_place
