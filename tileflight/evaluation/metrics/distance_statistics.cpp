#include "tileflight/evaluation/metrics/distance_statistics.h"

#include <nlohmann/json.hpp>

#include "tileflight/core/base/strict_section.h"

namespace tileflight::metrics {

nlohmann::json distance_statistics_json(const DistanceStatistics& statistics) {
  return {{"points", statistics.count},
          {"mean", statistics.mean},
          {"std", statistics.std},
          {"median", statistics.median},
          {"rmse", statistics.rmse}};
}

DistanceStatistics take_distance_statistics(base::StrictSection& section) {
  DistanceStatistics statistics;
  statistics.count = section.required_count("points");
  statistics.mean = section.required_number("mean");
  statistics.std = section.required_number("std");
  statistics.median = section.required_number("median");
  statistics.rmse = section.required_number("rmse");
  return statistics;
}

DistanceStatistics read_distance_statistics(base::StrictSection section) {
  const DistanceStatistics statistics = take_distance_statistics(section);
  section.require_all_keys_used();
  return statistics;
}

}  // namespace tileflight::metrics
