#include "tileflight/experiment/failure.h"

#include <cstdio>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/evaluation/agreement.h"
#include "tileflight/evaluation/missed_places.h"
#include "tileflight/experiment/evaluate.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/trajectory.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// A flight's pictures, and which of them were tracked.
struct Tracked {
  geometry::Trajectory frames;  ///< times only
  std::vector<bool> lost;
};

Tracked tracked_frames(const fs::path& flight) {
  constexpr double kSameFrame_s = 1e-4;
  Tracked result;
  for (const dataset::Frame& frame : dataset::read_dataset(flight / "dataset").frames)
    result.frames.poses.push_back({frame.time_s, geometry::SE3()});
  result.lost.assign(result.frames.size(), true);
  const geometry::Trajectory poses = geometry::read_tum(flight / "odometry/trajectory.txt");
  for (const auto& [frame, pose] : geometry::associate(result.frames, poses, kSameFrame_s)) result.lost[frame] = false;
  return result;
}

json lost_frames(const fs::path& run) {
  constexpr double kSameTime_s = 0.005;  // the flights have the same times, but for how they are written
  const Tracked simulated = tracked_frames(run / "simulated"), real = tracked_frames(run / "real");
  evaluation::Agreement lost;
  std::string csv = "time_s,lost_by\n";
  for (const auto& [s, r] : geometry::associate(simulated.frames, real.frames, kSameTime_s)) {
    lost.add(simulated.lost[s], real.lost[r]);
    if (!simulated.lost[s] && !real.lost[r]) continue;
    char line[64];
    std::snprintf(line, sizeof line, "%.6f,%s\n", real.frames.poses[r].time_s,
                  !real.lost[r]        ? "simulated"
                  : !simulated.lost[s] ? "real"
                                       : "both");
    csv += line;
  }
  geometry::write_file(run / "lost-frames.csv", csv);
  return evaluation::to_json(lost);
}

json missed_places(const fs::path& run, const EvaluationSettings& settings, std::uint64_t seed) {
  const fs::path simulated = seen_file(run / "simulated/metrics.json"), real = seen_file(run / "real/metrics.json");
  if (!fs::exists(simulated) || !fs::exists(real)) return nullptr;
  const double cell_m = settings.agreement_cell_m;
  const evaluation::MissedPlaces places =
      evaluation::missed_places(read_seen(simulated), read_seen(real),
                                {.cell_m = cell_m, .within_m = cell_m / 2, .block_m = 10 * cell_m, .seed = seed});
  geometry::write_file(run / "missed-places.csv", evaluation::places_csv(places));
  return evaluation::to_json(places);
}

}  // namespace

json predict_failure(const fs::path& run, const EvaluationSettings& settings, bool follows, std::uint64_t seed) {
  const json result{{"frames", follows ? lost_frames(run) : json(nullptr)},
                    {"places", missed_places(run, settings, seed)}};
  geometry::write_file(run / "failure.json", result.dump(2) + "\n");
  return result;
}

}  // namespace tileflight::experiment
