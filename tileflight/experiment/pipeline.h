#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tileflight/experiment/experiment_file.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/map_inputs.h"
#include "tileflight/experiment/stage_cache.h"
#include "tileflight/experiment/track.h"

namespace tileflight::experiment {

/// One of the experiment's flights and where its stages leave their results.
struct FlightStages {
  std::string name;  ///< "simulated" or "real"
  const Flight& flight;
  std::filesystem::path folder;  ///< DIR/simulated or DIR/real
};

/// One of the times that a flight is tracked, aligned and scored.
struct OdometryRun {
  std::string name;              ///< of its stages: "simulated" for the first, then "simulated/runs/2", …
  std::filesystem::path folder;  ///< odometry/, transform.json, metrics.json, errors.ply
  odometry::OdometryOptions options;
  FrameRange frames;
  bool repeats = false;  ///< not the first
};

/// An experiment in its run folder: what each stage is made from (for the cache) and with which settings.
class Pipeline {
 public:
  Pipeline(const Experiment& experiment, std::filesystem::path folder, const StageCache& cache);

  /// In the order in which they are flown.
  const std::vector<FlightStages>& flights() const { return flights_; }
  bool simulated_follows_real() const;
  /// The experiment that flies a variant of the simulated flight alone, over the same place.
  Experiment variant_of(const Variant& variant) const;

  bool uses_built_in_place() const;
  void make_place(const Progress& progress) const;
  /// The first in the flight's own folder; further ones in FLIGHT/runs/2, …, and FLIGHT/runs/1-backwards, ….
  std::vector<OdometryRun> runs(const FlightStages& flight) const;
  std::vector<OdometryRun> runs_of(const std::string& flight) const;
  std::vector<std::string> odometry_products(const OdometryRun& run) const;
  std::vector<std::string> evaluation_products(const OdometryRun& run) const;

  ExtractSettings extract_settings() const;
  RenderSettings render_settings(const FlightStages& flight) const;

  nlohmann::json place_inputs() const;
  nlohmann::json truth_inputs() const;
  nlohmann::json dataset_inputs(const FlightStages& flight) const;
  nlohmann::json followed_inputs() const;
  nlohmann::json reproduction_inputs() const;
  nlohmann::json odometry_inputs(const FlightStages& flight, const OdometryRun& run) const;
  nlohmann::json alignment_inputs(const FlightStages& flight, const OdometryRun& run) const;
  /// The other flights' first runs, whose odometry is done.
  std::vector<MapInputs> maps_of_others(const FlightStages& flight) const;
  nlohmann::json evaluation_inputs(const OdometryRun& run) const;
  nlohmann::json comparison_inputs() const;
  nlohmann::json failure_inputs() const;

 private:
  std::string resolved(const std::string& source) const;
  std::string source_fingerprint(const std::string& source) const;
  tiles::SourceOptions source_options() const;
  std::string section(const std::string& name) const;

  const Experiment& experiment_;
  std::filesystem::path folder_;
  const StageCache& cache_;
  std::vector<FlightStages> flights_;
};

}  // namespace tileflight::experiment
