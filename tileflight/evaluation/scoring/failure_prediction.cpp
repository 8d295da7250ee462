#include "tileflight/evaluation/scoring/failure_prediction.h"

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/metrics/contingency_table.h"
#include "tileflight/evaluation/metrics/missed_places.h"
#include "tileflight/evaluation/scoring/evaluate.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// A flight's frames, and which of them were tracked.
struct TrackedFrames {
  geometry::Trajectory frames;  ///< times only
  std::vector<bool> lost;
};

TrackedFrames read_tracked_frames(const fs::path& flight) {
  constexpr double kSameFrame_s = 1e-4;
  TrackedFrames result;
  for (const dataset::Frame& frame : dataset::read_dataset(flight / "dataset").frames)
    result.frames.poses.push_back({frame.time_s, geometry::SE3()});
  result.lost.assign(result.frames.size(), true);
  const geometry::Trajectory poses = geometry::read_tum(flight / "odometry/trajectory.txt");
  for (const auto& [frame, pose] : geometry::associate(result.frames, poses, kSameFrame_s)) result.lost[frame] = false;
  return result;
}

json lost_frames(const fs::path& run) {
  constexpr double kSameTime_s = 0.005;  // equal times of both flights may differ by the rounding of their text
  const TrackedFrames simulated = read_tracked_frames(run / "simulated"), real = read_tracked_frames(run / "real");
  metrics::ContingencyTable lost;
  std::string csv = "time_s,lost_by\n";
  for (const auto& [s, r] : geometry::associate(simulated.frames, real.frames, kSameTime_s)) {
    lost.add(simulated.lost[s], real.lost[r]);
    if (!simulated.lost[s] && !real.lost[r]) continue;
    const char* lost_by = !real.lost[r] ? "simulated" : !simulated.lost[s] ? "real" : "both";
    csv += base::rounded_text(real.frames.poses[r].time_s, 6) + "," + lost_by + "\n";
  }
  base::write_file(run / "lost-frames.csv", csv);
  return metrics::to_json(lost);
}

json missed_places(const fs::path& run, const EvaluationSettings& settings, std::uint64_t seed) {
  const fs::path simulated = seen_surface_file(run / "simulated/metrics.json"),
                 real = seen_surface_file(run / "real/metrics.json");
  if (!fs::exists(simulated) || !fs::exists(real)) return nullptr;
  const double cell_m = settings.agreement_cell_m;
  const metrics::MissedPlaces places =
      metrics::missed_places(read_seen_surface(simulated), read_seen_surface(real),
                             {.cell_m = cell_m, .within_m = cell_m / 2, .block_m = 10 * cell_m, .seed = seed});
  base::write_file(run / "missed-places.csv", metrics::missed_places_csv(places));
  return metrics::to_json(places);
}

}  // namespace

json predict_failure(const fs::path& run, const EvaluationSettings& settings, bool follows, std::uint64_t seed) {
  const json result{{"frames", follows ? lost_frames(run) : json(nullptr)},
                    {"places", missed_places(run, settings, seed)}};
  base::write_file(run / "failure.json", result.dump(2) + "\n");
  return result;
}

}  // namespace tileflight::scoring
