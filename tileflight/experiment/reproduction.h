#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tileflight/geometry/progress.h"

namespace tileflight::experiment {

/// How well the simulated flight of a run repeats the one that it follows. Pictures are paired by time (within half of
/// the followed flight's frame interval); at most 200 pairs, evenly chosen, are looked at. Of each pair:
///   overlap    share of surface seen by both (sensors/view_overlap.h), on the ground truth's mesh,
///   ncc, ssim  likeness of the pictures (imaging/similarity.h), over the lens's image,
///   position_m, rotation_deg   between the poses, where the followed flight's true ones are known.
/// Over the flight: medians, tenth percentiles, and
///   time_offset_s   by which the simulated pictures would have to be later to be most alike (mean ncc over shifts by
///                   whole frames, a parabola through the best three); null where the best lies at the end of what was
///                   tried, or no picture has contrast,
///   excerpt         the longest stretch of pairs with an overlap of at least 0.8.
/// Poses of the followed flight are the true ones where they are known ("poses": "true"), else the estimated ones,
/// which are those flown ("estimated": overlap and pose difference then say little). Reads RUN/real, RUN/simulated and
/// RUN/truth; writes RUN/reproduction.json, which is returned, and RUN/reproduction.csv. Throws InputError: no two
/// pictures of one time.
nlohmann::json measure_reproduction(const std::filesystem::path& run, const Progress& progress = {});

}  // namespace tileflight::experiment
