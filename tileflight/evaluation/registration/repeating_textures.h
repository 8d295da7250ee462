#pragma once

#include <optional>

#include "tileflight/evaluation/registration/start_refiner.h"

namespace tileflight::registration {

/// Textures may repeat (floor tiles, modelled places): over ground whose shape does not constrain the map, the images
/// may fit at a shifted place as well, or better. Tests shifted placements and moves `T` to a better one. Returns the
/// distance of a placement that fits equally well, if any.
std::optional<double> find_repetition(const StartRefiner& follower, const alignment::PointSpread& spread,
                                      geometry::Sim3& T);

}  // namespace tileflight::registration
