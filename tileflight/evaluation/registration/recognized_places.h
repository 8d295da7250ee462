#pragma once

// Order of the candidates of a registration, and whether the images fit more than one. A place may contain the same
// twice (the corners of a court, row houses): the first one at which images are located is not always the right one.

#include <optional>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/start_refiner.h"

namespace tileflight::registration {

/// Textures may repeat (floor tiles, modelled places): over ground whose shape does not constrain the map, the images
/// may fit at a shifted place as well, or better. Tests shifted placements and moves `T` to a better one. Returns the
/// distance of a placement that fits equally well, if any.
std::optional<double> find_repetition(const StartRefiner& follower, const alignment::PointSpread& spread,
                                      geometry::Sim3& T);

/// Recognised by images first; of those, the one whose images that agree explain more: their number times the square of
/// their correlation, the share of the grey values' variance. The others by ray agreement.
bool is_better(const Candidate& a, const Candidate& b);

/// Placements at most so far from `T` (RMS over the map's points, metres) are the same place: a fiftieth of the map's
/// size, and at least half a metre.
double same_place_m(const geometry::Sim3& T, const alignment::PointSpread& spread);

/// Compares the first candidate with the others where the images are recognised, by `pictures` images at full accuracy:
/// another one that fits better becomes the first. Returns the distance (RMS over the map's points) to the nearest
/// other place that fits nearly as well as the first then; nullopt if there is none. `candidates`: best first; not
/// empty.
std::optional<double> find_similar_place(std::vector<Candidate>& candidates, const StartRefiner& refiner,
                                         std::size_t pictures, const alignment::PointSpread& spread);

}  // namespace tileflight::registration
