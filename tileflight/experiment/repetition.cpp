#include "tileflight/experiment/repetition.h"

#include <algorithm>
#include <set>
#include <string>

#include "tileflight/evaluation/repeated_runs.h"
#include "tileflight/experiment/run_folder.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

fs::path failure_file(const OdometryRun& run) { return run.folder / "failed.txt"; }

bool has_failed(const OdometryRun& run) { return fs::exists(failure_file(run)); }

json read_json(const fs::path& file) {
  json value = json::parse(geometry::read_text(file), nullptr, false);
  if (value.is_discarded()) throw InputError(file.string(), "not valid JSON");
  return value;
}

json at_or_null(const json& object, const char* place) {
  const json::json_pointer pointer(place);
  return object.contains(pointer) ? object.at(pointer) : json(nullptr);
}

/// "1" for the first run, "2", "1-backwards".
std::string short_name(const OdometryRun& run) { return run.repeats ? run.folder.filename().string() : "1"; }

json line_of(const OdometryRun& run, const StageCache& cache) {
  const bool failed = has_failed(run);
  // What an earlier run of the program left from other inputs is none of this one.
  const bool has_odometry = cache.has(run.name + "/odometry");
  const json odometry = has_odometry ? read_json(run.folder / "odometry/odometry.json") : json::object();
  const json metrics = failed ? json::object() : read_json(run.folder / "metrics.json");
  return {{"name", short_name(run)},
          {"seed", run.options.start.seed},
          {"from", run.frames.from},
          {"backwards", run.frames.reverse},
          {"failed", failed ? json(geometry::read_text(failure_file(run))) : json(nullptr)},
          {"frames_tracked", at_or_null(odometry, "/frames_tracked")},
          {"lost", at_or_null(odometry, "/lost")},
          {"points", at_or_null(metrics, "/map/points")},
          {"mean", at_or_null(metrics, "/map/mean")},
          {"surface_median", at_or_null(metrics, "/surface/median")},
          {"ate_rmse", at_or_null(metrics, "/trajectory/ate_rmse")}};
}

std::size_t distinct_maps(const std::vector<OdometryRun>& runs) {
  std::set<std::string> maps;
  for (const OdometryRun& run : runs) {
    if (!has_failed(run)) maps.insert(geometry::sha256_hex_of_file(run.folder / "odometry/map.ply"));
  }
  return maps.size();
}

}  // namespace

void attempt(const OdometryRun& run, const std::function<void()>& stages) {
  if (!run.repeats) {
    stages();
    return;
  }
  fs::create_directories(run.folder);
  fs::remove(failure_file(run));
  try {
    stages();
  } catch (const InputError& error) {
    geometry::write_file(failure_file(run), error.what());
  }
}

void require_map(const OdometryRun& run, const fs::path& dataset) {
  const json about = read_json(run.folder / "odometry/odometry.json");
  if (about.value("frames_tracked", json()) == 0)
    throw InputError(dataset.string(), about.value("lost_reason", "no frame was tracked"));
}

void forget_other_runs(const fs::path& flight, const std::vector<OdometryRun>& runs) {
  if (!fs::is_directory(flight / "runs")) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(flight / "runs")) {
    if (std::ranges::none_of(runs, [&](const OdometryRun& run) { return run.folder == entry.path(); }))
      remove_results(entry.path());
  }
}

std::vector<fs::path> scored(const std::vector<OdometryRun>& runs) {
  std::vector<fs::path> files;
  for (const OdometryRun& run : runs) {
    if (!has_failed(run)) files.push_back(run.folder / "metrics.json");
  }
  return files;
}

nlohmann::json describe_runs(const std::vector<OdometryRun>& runs, const StageCache& cache) {
  if (runs.size() < 2) return nullptr;
  json list = json::array();
  for (const OdometryRun& run : runs) list.push_back(line_of(run, cache));
  std::vector<json> metrics;
  for (const fs::path& file : scored(runs)) metrics.push_back(read_json(file));
  return {{"n", runs.size()},
          {"failed", runs.size() - metrics.size()},
          {"distinct", distinct_maps(runs)},
          {"list", list},
          {"spread", evaluation::spread_of_numbers(metrics)}};
}

}  // namespace tileflight::experiment
