#include "tileflight/experiments/experiment/results.h"

#include <nlohmann/json.hpp>
#include <optional>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/metrics/published_results.h"
#include "tileflight/evaluation/scoring/warnings.h"
#include "tileflight/experiments/experiment/repetition.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

/// Describes the dataset: number of frames, field of view, resolution, frame rate, duration.
json describe_dataset(const fs::path& folder) {
  const dataset::Dataset data = dataset::read_dataset(folder);
  const imaging::Camera& camera = data.calibration.camera;
  const double duration_s = data.frames.back().time_s - data.frames.front().time_s;
  const double intervals = static_cast<double>(data.frames.size()) - 1.0;
  return {{"frames", data.frames.size()},
          {"fov_deg", camera.horizontal_fov_deg()},
          {"resolution", {camera.width(), camera.height()}},
          {"fps", duration_s > 0 ? intervals / duration_s : 0.0},
          {"duration_s", duration_s}};
}

json describe_flight(const FlightConfig& flight, const fs::path& folder, const std::vector<OdometryRun>& runs,
                     bool has_place, const StageCache& cache) {
  json result = base::read_json(folder / "metrics.json");
  result.update(describe_dataset(folder / "dataset"));
  result["kind"] = flight.kind;
  result["odometry"] = base::read_json(folder / "odometry/odometry.json");
  result["alignment"] = has_place ? base::read_json(folder / "transform.json") : json(nullptr);
  result["runs"] = describe_runs(runs, cache);
  return result;
}

json describe_inputs(const Experiment& experiment, const StageCache& cache) {
  json inputs = json::array();
  for (const fs::path& file : input_files(experiment)) {
    inputs.push_back({{"path", file.string()}, {"sha256", cache.content_hash(file)}});
  }
  return inputs;
}

/// Warnings of all flights' scores, each under its flight's name; those about the ground truth once.
Warnings all_warnings(const Pipeline& pipeline, const std::optional<place::ExtractResult>& truth) {
  Warnings warnings;
  if (truth)
    warnings = scoring::truth_warnings(*truth);
  else
    warnings.push_back({"no place is given, so the error of the map cannot be known", "place", Severity::kWarning,
                        "give the tileset of the place: `place: {source: ...}`, or --place for a video"});
  for (const FlightStages& f : pipeline.flights()) {
    Warnings own = scoring::read_warnings(f.folder / "metrics.json");
    if (f.flight.ingest) {
      const json ingested = base::read_json(f.folder / "ingest.json");
      scoring::append_distinct(own, make_notes(ingested["warnings"].get<std::vector<std::string>>(), "dataset"));
    }
    std::erase_if(own, [](const Warning& warning) { return warning.where == "truth"; });
    scoring::append_distinct(warnings, scoring::prefix_with_flight(std::move(own), f.name));
  }
  return warnings;
}

}  // namespace

std::vector<fs::path> input_files(const Experiment& experiment) {
  std::vector<fs::path> files{experiment.file};
  const auto add = [&files](const fs::path& file) {
    if (!file.empty() && fs::exists(file)) files.push_back(file);
  };
  add(experiment.place.source);
  add(experiment.odometry.track_options.mask);
  for (const fs::path& file : odometry_program_files(experiment)) add(file);
  for (const auto* flight : {&experiment.simulated, &experiment.real}) {
    if (!flight->has_value()) continue;
    if ((*flight)->render) {
      add((*flight)->render->flight);
      add((*flight)->render->source);
    }
    if ((*flight)->ingest) {
      for (const fs::path& file :
           {(*flight)->ingest->video, (*flight)->ingest->camera, (*flight)->ingest->telemetry, (*flight)->ingest->imu,
            (*flight)->ingest->imu_noise, (*flight)->ingest->groundtruth}) {
        add(file);
      }
    }
  }
  return files;
}

nlohmann::json collect_results(const Experiment& experiment, const Pipeline& pipeline, const StageCache& cache) {
  const fs::path& run = cache.run_folder();
  std::optional<place::ExtractResult> truth;
  if (experiment.has_place()) truth = place::read_extract_json(run / "truth");
  json results{{"name", experiment.name},
               {"paper", metrics::published_table()},
               {"truth", truth ? to_json(*truth) : json(nullptr)}};
  for (const FlightStages& f : pipeline.flights())
    results[f.name] = describe_flight(f.flight, f.folder, pipeline.runs(f), experiment.has_place(), cache);
  results["comparison"] =
      experiment.simulated && experiment.real ? base::read_json(run / "comparison.json") : json(nullptr);
  results["failure"] = experiment.simulated && experiment.real ? base::read_json(run / "failure.json") : json(nullptr);
  const bool follows =
      experiment.simulated && experiment.simulated->render && experiment.simulated->render->follows_real;
  results["reproduction"] = follows ? base::read_json(run / "reproduction.json") : json(nullptr);
  results["warnings"] = to_json(all_warnings(pipeline, truth));
  results["provenance"] = {{"version", base::version()},
                           {"commit", base::commit()},
                           {"seed", experiment.seed},
                           {"command", "tileflight run " + experiment.file.string() + " --out " + run.string()},
                           {"inputs", describe_inputs(experiment, cache)},
                           {"cut_sha256", truth ? json(truth->cut_sha256) : json(nullptr)},
                           {"attribution", truth ? json(truth->attribution) : json::array()},
                           {"terms_accepted", truth && truth->terms_accepted},
                           {"seconds", cache.seconds()}};
  return results;
}

}  // namespace tileflight::experiment
