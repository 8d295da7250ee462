#include "tileflight/experiments/experiment/repetition.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/evaluation/metrics/repeated_runs.h"
#include "tileflight/experiments/experiment/run_folder.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

fs::path failure_file(const OdometryRun& run) { return run.folder / "failed.txt"; }

bool has_failed(const OdometryRun& run) { return fs::exists(failure_file(run)); }

json value_or_null(const json& object, const char* place) {
  const json::json_pointer pointer(place);
  return object.contains(pointer) ? object.at(pointer) : json(nullptr);
}

/// "1" for the first run, "2", "1-backwards".
std::string run_label(const OdometryRun& run) { return run.is_repeat ? run.folder.filename().string() : "1"; }

json run_row(const OdometryRun& run, const StageCache& cache) {
  const bool failed = has_failed(run);
  // Results of an earlier call with other inputs do not belong to this run.
  const bool has_odometry = cache.is_done(run.name + "/odometry");
  const json odometry = has_odometry ? base::read_json(run.folder / "odometry/odometry.json") : json::object();
  const json metrics = failed ? json::object() : base::read_json(run.folder / "metrics.json");
  return {{"name", run_label(run)},
          {"seed", run.options.initialization.seed},
          {"from", run.frames.from},
          {"backwards", run.frames.reverse},
          {"failed", failed ? json(base::read_text(failure_file(run))) : json(nullptr)},
          {"frames_tracked", value_or_null(odometry, "/frames_tracked")},
          {"lost", value_or_null(odometry, "/lost")},
          {"points", value_or_null(metrics, "/map/points")},
          {"mean", value_or_null(metrics, "/map/mean")},
          {"surface_median", value_or_null(metrics, "/surface/median")},
          {"ate_rmse", value_or_null(metrics, "/trajectory/ate_rmse")}};
}

std::size_t distinct_maps(const std::vector<OdometryRun>& runs) {
  std::set<std::string> maps;
  for (const OdometryRun& run : runs) {
    if (!has_failed(run)) maps.insert(base::sha256_hex_of_file(run.folder / "odometry/map.ply"));
  }
  return maps.size();
}

}  // namespace

void run_repetition(const OdometryRun& run, const std::function<void()>& stages) {
  if (!run.is_repeat) {
    stages();
    return;
  }
  fs::create_directories(run.folder);
  fs::remove(failure_file(run));
  try {
    stages();
  } catch (const InputError& error) {
    base::write_file(failure_file(run), error.what());
  }
}

void require_tracked_frames(const OdometryRun& run, const fs::path& dataset) {
  const json about = base::read_json(run.folder / "odometry/odometry.json");
  if (about.value("frames_tracked", json()) == 0)
    throw InputError(dataset.string(), about.value("lost_reason", "no frame was tracked"));
}

void remove_stale_runs(const fs::path& flight, const std::vector<OdometryRun>& runs) {
  if (!fs::is_directory(flight / "runs")) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(flight / "runs")) {
    if (std::ranges::none_of(runs, [&](const OdometryRun& run) { return run.folder == entry.path(); }))
      remove_results(entry.path());
  }
}

std::vector<fs::path> scored_metrics_files(const std::vector<OdometryRun>& runs) {
  std::vector<fs::path> files;
  for (const OdometryRun& run : runs) {
    if (!has_failed(run)) files.push_back(run.folder / "metrics.json");
  }
  return files;
}

nlohmann::json describe_runs(const std::vector<OdometryRun>& runs, const StageCache& cache) {
  if (runs.size() < 2) return nullptr;
  json list = json::array();
  for (const OdometryRun& run : runs) list.push_back(run_row(run, cache));
  std::vector<json> metrics;
  for (const fs::path& file : scored_metrics_files(runs)) metrics.push_back(base::read_json(file));
  return {{"n", runs.size()},
          {"failed", runs.size() - metrics.size()},
          {"distinct", distinct_maps(runs)},
          {"list", list},
          {"spread", metrics::compute_json_spread(metrics)}};
}

}  // namespace tileflight::experiment
