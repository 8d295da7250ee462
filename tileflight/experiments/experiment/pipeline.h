#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/evaluation/scoring/map_inputs.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/stage_cache.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/tiles/demo_place/synthetic_place.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::experiment {

/// One of the experiment's flights and the folder of its results.
struct FlightStages {
  std::string name;  ///< "simulated" or "real"
  const FlightConfig& flight;
  std::filesystem::path folder;  ///< DIR/simulated or DIR/real
};

/// One tracking run of a flight, with its alignment and scores.
struct OdometryRun {
  std::string name;              ///< prefix of its stages: "simulated" (the first), "simulated/runs/2", …
  std::filesystem::path folder;  ///< odometry/, transform.json, metrics.json, errors.ply
  odometry::OdometryOptions options;
  odometry::FrameRange frames;
  bool is_repeat = false;  ///< not the first run
};

/// An experiment in its run folder: the inputs of each stage (for the cache) and its settings.
class Pipeline {
 public:
  /// Throws InputError for a built-in place that does not exist, and for two of them.
  Pipeline(const Experiment& experiment, std::filesystem::path folder, const StageCache& cache);

  /// The flights in the order of execution.
  const std::vector<FlightStages>& flights() const { return flights_; }
  bool simulated_follows_real() const;
  /// Returns the experiment of a variant: the simulated flight alone, with the changes. Stages that these do not affect
  /// have the keys of this experiment.
  Experiment make_variant(const Variant& variant) const;

  bool uses_built_in_place() const { return built_in_.has_value(); }
  /// Writes the built-in place into a folder that may exist.
  void build_place(const std::filesystem::path& folder, const Progress& progress) const;
  /// Returns the runs of a flight. The first one is in the flight's own folder, further ones in FLIGHT/runs/2, …, and
  /// FLIGHT/runs/1-backwards, ….
  std::vector<OdometryRun> runs(const FlightStages& flight) const;
  std::vector<OdometryRun> find_runs(const std::string& flight) const;
  std::vector<std::string> odometry_products(const OdometryRun& run) const;
  std::vector<std::string> evaluation_products(const OdometryRun& run) const;

  place::ExtractSettings extract_settings() const;
  recording::RenderSettings render_settings(const FlightStages& flight) const;

  nlohmann::json place_inputs() const;
  /// Returns the hash of all inputs of the built-in place.
  std::string place_key() const;
  nlohmann::json truth_inputs() const;
  /// Returns the hash of the inputs of the ground truth by content, wherever its tiles lie: equal ground truths have
  /// equal keys.
  std::string truth_key() const;
  nlohmann::json dataset_inputs(const FlightStages& flight) const;
  nlohmann::json followed_inputs() const;
  nlohmann::json reproduction_inputs() const;
  nlohmann::json odometry_inputs(const FlightStages& flight, const OdometryRun& run) const;
  nlohmann::json alignment_inputs(const FlightStages& flight, const OdometryRun& run) const;
  /// The first runs of the other flights whose odometry is done.
  std::vector<scoring::MapInputs> other_flights_maps(const FlightStages& flight) const;
  nlohmann::json localization_inputs(const OdometryRun& run) const;
  nlohmann::json evaluation_inputs(const FlightStages& flight, const OdometryRun& run) const;
  nlohmann::json comparison_inputs() const;
  nlohmann::json failure_inputs() const;

 private:
  std::string resolve_source(const std::string& source) const;
  std::string source_fingerprint(const std::string& source) const;
  fetch::SourceOptions source_options() const;
  std::string section_hash(const std::string& name) const;

  const Experiment& experiment_;
  std::filesystem::path folder_;
  const StageCache& cache_;
  std::vector<FlightStages> flights_;
  std::optional<demo_place::BuiltInSource> built_in_;  ///< that the region or a flight is of
};

}  // namespace tileflight::experiment
