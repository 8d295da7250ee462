#pragma once

#include <nlohmann/json_fwd.hpp>

#include "tileflight/evaluation/metrics/metrics.h"

namespace tileflight::base {
class StrictSection;
}

// Statistics of distances as they stand in metrics.json: {points, mean, std, median, rmse}.

namespace tileflight::metrics {

nlohmann::json distance_statistics_json(const DistanceStatistics& statistics);
/// Reads the keys from a section that may have others. Throws InputError as StrictSection does.
DistanceStatistics take_distance_statistics(base::StrictSection& section);
/// Reads a section that has no other keys. Throws InputError as StrictSection does.
DistanceStatistics read_distance_statistics(base::StrictSection section);

}  // namespace tileflight::metrics
