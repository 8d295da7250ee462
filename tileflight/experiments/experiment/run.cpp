#include "tileflight/experiments/experiment/run.h"

#include <algorithm>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <nlohmann/json_fwd.hpp>
#include <sstream>
#include <vector>

#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/capture/recording/render_stage.h"
#include "tileflight/capture/recording/reproduction.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/output_folder.h"
#include "tileflight/core/base/program.h"
#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/compare_maps.h"
#include "tileflight/evaluation/scoring/evaluate.h"
#include "tileflight/evaluation/scoring/evaluate_trajectories.h"
#include "tileflight/evaluation/scoring/failure_prediction.h"
#include "tileflight/evaluation/scoring/localize_stage.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/folder_cache.h"
#include "tileflight/experiments/experiment/pipeline.h"
#include "tileflight/experiments/experiment/repetition.h"
#include "tileflight/experiments/experiment/results.h"
#include "tileflight/experiments/experiment/run_folder.h"
#include "tileflight/experiments/experiment/stage_cache.h"
#include "tileflight/experiments/report/report.h"
#include "tileflight/slam/external_systems/run_system.h"
#include "tileflight/slam/odometry/track.h"
#include "tileflight/tiles/fetch/url_secrets.h"
#include "tileflight/world/place/extract.h"

namespace tileflight::experiment {

namespace fs = std::filesystem;
using nlohmann::json;

namespace {

/// Runs the experiment of a variant into a folder and returns its results.json.
using VariantRunner = std::function<nlohmann::json(const Variant& variant, const std::filesystem::path& folder)>;

/// Columns and their JSON pointers in results.json.
const std::vector<std::pair<const char*, json::json_pointer>>& columns() {
  static const std::vector<std::pair<const char*, json::json_pointer>> kColumns{
      {"frames", json::json_pointer("/simulated/frames")},
      {"frames_tracked", json::json_pointer("/simulated/odometry/frames_tracked")},
      {"keyframes", json::json_pointer("/simulated/odometry/keyframes")},
      {"points", json::json_pointer("/simulated/map/points")},
      {"correspondences", json::json_pointer("/simulated/map/correspondences")},
      {"mean_m", json::json_pointer("/simulated/map/mean")},
      {"std_m", json::json_pointer("/simulated/map/std")},
      {"median_to_surface_m", json::json_pointer("/simulated/surface/median")},
      {"ate_rmse_m", json::json_pointer("/simulated/trajectory/ate_rmse")}};
  return kColumns;
}

json variant_row(const std::string& name, const json& results) {
  json line{{"name", name}, {"failed", nullptr}};
  for (const auto& [key, where] : columns()) line[key] = results.contains(where) ? results.at(where) : json(nullptr);
  const json::json_pointer length("/simulated/trajectory/path_length");
  line["ate_share"] = nullptr;
  if (line["ate_rmse_m"].is_number() && results.contains(length) && results.at(length).get<double>() > 0)
    line["ate_share"] = line["ate_rmse_m"].get<double>() / results.at(length).get<double>();
  return line;
}

json failed_row(const std::string& name, const std::string& why) {
  json line = variant_row(name, json::object());
  line["failed"] = why;
  return line;
}

std::string to_csv(const json& lines) {
  std::ostringstream text;
  text << "name";
  for (const auto& column : columns()) text << ',' << column.first;
  text << ",ate_share,failed\n";
  const auto cell = [](const json& value) { return value.is_null() ? std::string() : value.dump(); };
  for (const json& line : lines) {
    text << line["name"].get<std::string>();
    for (const auto& column : columns()) text << ',' << cell(line[column.first]);
    text << ',' << cell(line["ate_share"]) << ',' << (line["failed"].is_null() ? "" : "yes") << "\n";
  }
  return text.str();
}

/// Removes the results of variants that are no longer requested.
void remove_stale_variants(const std::vector<Variant>& variants, const fs::path& folder) {
  if (!fs::is_directory(folder)) return;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (std::ranges::none_of(variants, [&](const Variant& v) { return v.name == name; })) remove_results(entry.path());
  }
}

/// Runs an ablation: flies each variant in RUN/variants/NAME. Returns a list that starts with the unchanged simulated
/// flight (`results` of the run itself), then one entry per variant: name, frames, frames_tracked, keyframes, points,
/// correspondences, mean_m, std_m (the paper's numbers), median_to_surface_m, ate_rmse_m, ate_share (of the path
/// length), and `failed` (the cause; the others are null) if odometry found no map. Unknown values are null. Also
/// writes RUN/ablation.csv. Variants of an earlier run that are no longer requested are removed.
json run_variants(const std::vector<Variant>& variants, const json& results, const fs::path& run,
                  const VariantRunner& fly) {
  remove_stale_variants(variants, run / "variants");
  json lines = json::array();
  lines.push_back(variant_row("as it is", results));
  for (const Variant& variant : variants) {
    const fs::path folder = run / "variants" / variant.name;
    fs::create_directories(folder.parent_path());
    try {
      lines.push_back(variant_row(variant.name, fly(variant, folder)));
    } catch (const InputError& error) {
      // A camera too poor for any map is a valid result; a failure before odometry is an error.
      if (!fs::exists(folder / "stages/simulated-odometry.json")) throw;
      lines.push_back(failed_row(variant.name, error.what()));
    }
  }
  base::write_file(run / "ablation.csv", to_csv(lines));
  return lines;
}

/// Runs another program on a flight's dataset. Throws InputError with the reason if it fails.
void run_other_odometry(const Experiment& experiment, const fs::path& dataset, const OdometryRun& run,
                        const Progress& progress) {
  const OdometryConfig& settings = experiment.odometry;
  if (settings.system) external_systems::require_installed(*settings.system);
  const external_systems::Adapter adapter =
      settings.system
          ? *settings.system
          : external_systems::command_adapter(settings.command, fs::absolute(experiment.file).parent_path());
  const json about = external_systems::run_system(
      adapter, dataset, run.folder / "odometry",
      {.seed = run.options.initialization.seed, .limits = {}, .program = {}, .replace = true}, progress);
  if (!about["system"]["completed"])
    throw InputError(settings.system ? "odometry.system " + adapter.name : "odometry.command",
                     about["system"]["reason"].get<std::string>());
}

/// Runs odometry on a flight's dataset: the built-in one, the experiment's system or its command.
void run_odometry_stage(const Experiment& experiment, const fs::path& dataset, const OdometryRun& run,
                        const Progress& progress) {
  const OdometryConfig& settings = experiment.odometry;
  fs::create_directories(run.folder);
  const fs::path pictures = run.folder / "keyframe_pictures";
  if (!settings.debug_pictures && fs::exists(pictures)) base::remove_output(pictures);
  if (!settings.is_built_in()) return run_other_odometry(experiment, dataset, run, progress);
  odometry::TrackOptions extras = settings.track_options;
  if (settings.debug_pictures) extras.debug_pictures = pictures;
  if (run.is_repeat) extras.check_reversed = false;  // a repeated run already has a fixed direction
  extras.odometry = run.options;
  extras.frames = run.frames;
  odometry::track(dataset, run.folder / "odometry", true, extras, progress);
}

/// Runs the stages of a flight if necessary, each with its inputs, its products and the function that executes it.
class FlightStageRunner {
 public:
  FlightStageRunner(const Experiment& experiment, const Pipeline& pipeline, StageCache& cache,
                    const RunOptions& options, const Progress& progress)
      : experiment_(experiment),
        pipeline_(pipeline),
        cache_(cache),
        options_(options),
        folder_(cache.run_folder()),
        progress_(progress) {}

  void make_dataset(const FlightStages& f) const {
    if (f.flight.render && f.flight.render->follows_real) {
      cache_.run_stage(f.name + "/flight", pipeline_.followed_inputs(), {f.name + "/flight"}, [&] {
        const fs::path located = experiment_.real->reference_tiles ? folder_ / "real/localized/trajectory.txt" : "";
        recording::write_followed_flight(folder_ / "real", f.flight.render->smoothing, f.folder / "flight", located);
      });
    }
    std::vector<std::string> products{f.name + "/dataset"};
    if (f.flight.ingest) products.push_back(f.name + "/ingest.json");
    cache_.run_stage(f.name + "/dataset", pipeline_.dataset_inputs(f), products, [&] {
      if (f.flight.render) {
        recording::RenderSettings settings = pipeline_.render_settings(f);
        settings.fly_autopilot = options_.fly_autopilot;
        recording::render_dataset(settings, f.folder / "dataset", true, progress_);
      }
      if (f.flight.ingest) {
        const fs::path truth = experiment_.has_place() ? folder_ / "truth" : fs::path();
        const ingest::IngestResult ingested =
            ingest::ingest_dataset(*f.flight.ingest, truth, f.folder / "dataset", true, progress_);
        base::write_file(f.folder / "ingest.json", to_json(ingested).dump(2) + "\n");
      }
    });
  }

  void track(const FlightStages& f) const {
    remove_stale_runs(f.folder, pipeline_.runs(f));
    for (const OdometryRun& r : pipeline_.runs(f)) {
      run_repetition(r, [&] {
        cache_.run_stage(r.name + "/odometry", pipeline_.odometry_inputs(f, r), pipeline_.odometry_products(r),
                         [&] { run_odometry_stage(experiment_, f.folder / "dataset", r, progress_); });
        require_tracked_frames(r, f.folder / "dataset");
      });
    }
  }

  void align_and_score(const FlightStages& f) const {
    for (const OdometryRun& r : pipeline_.runs(f)) {
      if (!cache_.is_done(r.name + "/odometry")) continue;  // a repeated run that failed
      run_repetition(r, [&] {
        require_tracked_frames(r, f.folder / "dataset");
        if (!experiment_.has_place()) return score_path(f, r);
        scoring::MapInputs map = scoring::find_map_inputs(r.folder / "odometry", f.folder / "dataset");
        map.others = pipeline_.other_flights_maps(f);
        const fs::path transform = r.folder / "transform.json";
        cache_.run_stage(r.name + "/alignment", pipeline_.alignment_inputs(f, r), {r.name + "/transform.json"},
                         [&] { scoring::align(map, folder_ / "truth", experiment_.alignment, transform, progress_); });
        if (f.flight.reference_tiles) {
          map.reference = r.folder / "localized";
          cache_.run_stage(r.name + "/localization", pipeline_.localization_inputs(r), {r.name + "/localized"}, [&] {
            scoring::localize({.dataset = f.folder / "dataset",
                               .place = (folder_ / "truth").string(),
                               .load = {},
                               .odometry = r.folder / "odometry",
                               .track = {},
                               .transform = transform,
                               .align = {}},
                              map.reference, true, progress_);
          });
        }
        const json inputs = pipeline_.evaluation_inputs(f, r);
        cache_.run_stage(r.name + "/evaluation", inputs, pipeline_.evaluation_products(r), [&] {
          scoring::evaluate(map, folder_ / "truth", transform, experiment_.evaluation, r.folder / "metrics.json",
                            progress_);
        });
      });
    }
  }

 private:
  /// Compares the path with the recorded positions, which is all that can be scored without a place.
  void score_path(const FlightStages& f, const OdometryRun& r) const {
    cache_.run_stage(r.name + "/evaluation", pipeline_.evaluation_inputs(f, r), {r.name + "/metrics.json"}, [&] {
      scoring::score_flight_without_place(r.folder / "odometry", f.folder / "dataset", r.folder / "metrics.json");
    });
  }

  const Experiment& experiment_;
  const Pipeline& pipeline_;
  StageCache& cache_;
  const RunOptions& options_;
  fs::path folder_;
  const Progress& progress_;
};

/// Writes the built-in place, or takes it from those that runs share.
void make_place(const Pipeline& pipeline, StageCache& cache, const RunOptions& options, const Progress& progress) {
  const fs::path place = cache.run_folder() / "place";
  const FolderCache shared(options.truth_cache, shared_places(), options.rerun_all, progress);
  const std::string key = pipeline.place_key();
  cache.run_stage(
      "place", pipeline.place_inputs(), {"place"},
      [&] { shared.make(key, place, [&](const fs::path& to) { pipeline.build_place(to, progress); }); },
      [&] { return shared.take(key, place); });
}

/// Extracts the truth, or takes it from those that runs share.
void make_truth(const Pipeline& pipeline, StageCache& cache, const RunOptions& options, const Progress& progress) {
  const fs::path truth = cache.run_folder() / "truth";
  const place::ExtractSettings settings = pipeline.extract_settings();
  const SharedKind truths = shared_truths(fetch::redact_source(settings.source));
  const FolderCache shared(options.truth_cache, truths, options.rerun_all, progress);
  const std::string key = options.truth_cache.empty() ? "" : pipeline.truth_key();
  cache.run_stage(
      "truth", pipeline.truth_inputs(), {"truth"},
      [&] { shared.make(key, truth, [&](const fs::path& to) { place::extract(settings, to, true, progress); }); },
      [&] { return shared.take(key, truth); });
}

/// Refuses a system that is not installed before the work that its odometry needs; what an earlier run left needs none.
void require_installed_systems(const Experiment& e, const fs::path& folder) {
  const auto require = [](const OdometryConfig& odometry, const fs::path& result) {
    if (odometry.system && !fs::exists(result)) external_systems::require_installed(*odometry.system);
  };
  if (e.simulated) require(e.odometry, folder / "simulated/odometry");
  if (e.real) require(e.odometry, folder / "real/odometry");
  for (const Variant& variant : e.variants)
    if (variant.odometry) require(*variant.odometry, folder / "variants" / variant.name / "simulated/odometry");
}

/// Prefixes a variant's stages with its name.
StageListener prefix_listener(const Variant& variant, const StageListener& listener) {
  if (!listener) return {};
  return [&variant, &listener](StageEvent news) {
    news.stage = "variants/" + variant.name + "/" + news.stage;
    listener(news);
  };
}

}  // namespace

// The pipeline. A stage is skipped if its inputs (settings, file contents, keys of earlier stages) are unchanged.
nlohmann::json run(const Experiment& e, const fs::path& folder, const Progress& progress, const RunOptions& options) {
  if (!options.until_datasets) require_installed_systems(e, folder);
  const RunFolder own(folder);
  if (options.rerun_all) invalidate_stages(folder);
  StageCache cache(folder, base::program_fingerprint(), own.hash_cache_file(), options.listener, options.original);
  const Pipeline p(e, folder, cache);

  if (p.uses_built_in_place()) make_place(p, cache, options, progress);
  if (e.has_place()) make_truth(p, cache, options, progress);

  const FlightStageRunner flight(e, p, cache, options, progress);
  const bool follows = p.simulated_follows_real();
  for (const FlightStages& f : p.flights()) {
    const bool is_followed = follows && f.name == "real";
    if (!options.flights.empty() && !is_followed && !std::ranges::count(options.flights, f.name)) continue;
    flight.make_dataset(f);
    if (options.until_datasets && !is_followed) continue;
    flight.track(f);
    if (follows) flight.align_and_score(f);  // the following flight needs the pose of the followed one
  }
  if (options.until_datasets) return nullptr;
  // Choosing regions for the alignment requires the points of both flights.
  if (!follows) std::ranges::for_each(p.flights(), [&](const FlightStages& f) { flight.align_and_score(f); });
  if (follows) {
    cache.run_stage("reproduction", p.reproduction_inputs(), {"reproduction.json", "reproduction.csv"},
                    [&] { recording::measure_reproduction(folder, progress); });
  }
  if (e.simulated && e.real) {
    cache.run_stage("comparison", p.comparison_inputs(), {"comparison.json"}, [&] {
      const json c = scoring::compare_flights(scored_metrics_files(p.find_runs("simulated")),
                                              scored_metrics_files(p.find_runs("real")), e.evaluation, e.seed);
      base::write_file(folder / "comparison.json", c.dump(2) + "\n");
    });
    cache.run_stage("failure", p.failure_inputs(), {"failure.json"},
                    [&] { scoring::predict_failure(folder, e.evaluation, follows, e.seed); });
  }
  json results = collect_results(e, p, cache);
  if (!e.variants.empty()) {
    results["ablation"] =
        run_variants(e.variants, results, folder, [&](const Variant& variant, const fs::path& its_folder) {
          return run(p.make_variant(variant), its_folder, progress,
                     {.listener = prefix_listener(variant, options.listener),
                      .original = folder,
                      .truth_cache = options.truth_cache,
                      .fly_autopilot = options.fly_autopilot});
        });
  }
  base::write_file(folder / "results.json", results.dump(2) + "\n");
  cache.run_stage("report", {{"results", base::sha256_hex(results.dump())}},
                  {"report.html", "report.json", "tables/key-figures.csv", "tables/key-figures.tex"},
                  [&] { report::write_report(folder); });
  return results;
}

}  // namespace tileflight::experiment
