#include "tileflight/evaluation/metrics/published_results.h"

#include <nlohmann/json.hpp>

namespace tileflight::metrics {

namespace {

nlohmann::json column(const PublishedRun& run) {
  return {
      {"points", run.points},   {"correspondences", run.correspondences}, {"mean", run.mean_m}, {"std", run.std_m},
      {"fov_deg", run.fov_deg}, {"resolution", run.resolution_px},        {"fps", run.fps},     {"frames", run.frames}};
}

}  // namespace

nlohmann::json published_table() {
  return {{"simulated", column(kPublishedSimulated)}, {"real", column(kPublishedReal)}, {"voxels", kPublishedVoxels}};
}

}  // namespace tileflight::metrics
