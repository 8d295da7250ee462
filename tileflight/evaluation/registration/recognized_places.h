#pragma once

// Order of the candidates of a registration, and tests whether the images fit more than one. A place may contain two
// parts that look alike (the corners of a court, row houses), so the first candidate at which images are located is not
// always the right one. Textures may also repeat (floor tiles).

#include <optional>
#include <vector>

#include "tileflight/core/alignment/similarity_chart.h"
#include "tileflight/evaluation/registration/start_refiner.h"

namespace tileflight::registration {

/// Tests whether repeating textures (floor tiles, modelled places) make the placement ambiguous. Over ground whose
/// shape does not constrain the map, the images may fit at a shifted place as well, or better. Tests shifted placements
/// and moves `T` to a better one. Returns the distance of a placement that fits equally well, if any.
std::optional<double> find_repetition(const StartRefiner& follower, const alignment::PointSpread& spread,
                                      geometry::Sim3& T);

/// Returns whether candidate `a` is better than `b`. A candidate that images recognise is better than one that they do
/// not. Of two recognised ones, the better one has the larger product of agreeing images and squared correlation, which
/// is the share of the grey values' variance that they explain. Other candidates compare by ray agreement.
bool is_better(const Candidate& a, const Candidate& b);

/// Returns the distance (RMS over the map's points, metres) up to which a placement is the same place as `T`: a
/// fiftieth of the map's size, and at least half a metre.
double same_place_m(const geometry::Sim3& T, const alignment::PointSpread& spread);

/// Looks for another place that fits the images as well as the first candidate. Compares the candidates where the
/// images are recognised by `pictures` images at full accuracy; one that fits better becomes the first. Returns the
/// distance (RMS over the map's points) from the first candidate to the nearest other place that fits nearly as well;
/// nullopt if there is none. `candidates`: best first, not empty.
std::optional<double> find_similar_place(std::vector<Candidate>& candidates, const StartRefiner& refiner,
                                         std::size_t pictures, const alignment::PointSpread& spread);

}  // namespace tileflight::registration
