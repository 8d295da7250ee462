#include "tileflight/experiment/run.h"

#include <algorithm>

#include "tileflight/experiment/ablation.h"
#include "tileflight/experiment/compare_maps.h"
#include "tileflight/experiment/evaluate.h"
#include "tileflight/experiment/extract.h"
#include "tileflight/experiment/failure.h"
#include "tileflight/experiment/fly.h"
#include "tileflight/experiment/follow.h"
#include "tileflight/experiment/pipeline.h"
#include "tileflight/experiment/repetition.h"
#include "tileflight/experiment/reproduction.h"
#include "tileflight/experiment/results.h"
#include "tileflight/experiment/run_folder.h"
#include "tileflight/experiment/score.h"
#include "tileflight/experiment/stage_cache.h"
#include "tileflight/experiment/track.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/output_folder.h"
#include "tileflight/report/report.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
using nlohmann::json;

namespace {

/// Odometry over a flight's dataset, our own or the experiment's command.
void find_map(const Experiment& experiment, const fs::path& dataset, const OdometryRun& run, const Progress& progress) {
  const Odometry& settings = experiment.odometry;
  fs::create_directories(run.folder);
  const fs::path pictures = run.folder / "keyframe_pictures";
  if (!settings.debug_pictures && fs::exists(pictures)) geometry::remove_output(pictures);
  if (!settings.command.empty()) {
    track_with_command(dataset, run.folder / "odometry", true, settings.command,
                       fs::absolute(experiment.file).parent_path());
    return;
  }
  TrackExtras extras = settings.extras;
  if (settings.debug_pictures) extras.debug_pictures = pictures;
  if (run.repeats) extras.second_opinion = false;  // a further run is in the direction that it is for
  track(dataset, run.folder / "odometry", true, run.options, run.frames, progress, extras);
}

/// The stages of a flight, each done when it has to be: what it is made from, what it leaves, and the call that does
/// it.
class FlightWork {
 public:
  FlightWork(const Experiment& experiment, const Pipeline& pipeline, StageCache& cache, const Progress& progress)
      : e_(experiment), p_(pipeline), cache_(cache), folder_(cache.run_folder()), progress_(progress) {}

  void film(const FlightStages& f) const {
    if (f.flight.render && f.flight.render->follows_real) {
      cache_.once(f.name + "/flight", p_.followed_inputs(), {f.name + "/flight"},
                  [&] { write_followed_flight(folder_ / "real", f.flight.render->smoothing, f.folder / "flight"); });
    }
    cache_.once(f.name + "/dataset", p_.dataset_inputs(f), {f.name + "/dataset"}, [&] {
      if (f.flight.render) render_dataset(p_.render_settings(f), f.folder / "dataset", true, progress_);
      if (f.flight.ingest) ingest_dataset(*f.flight.ingest, folder_ / "truth", f.folder / "dataset", true, progress_);
    });
  }

  void track(const FlightStages& f) const {
    forget_other_runs(f.folder, p_.runs(f));
    for (const OdometryRun& r : p_.runs(f)) {
      attempt(r, [&] {
        cache_.once(r.name + "/odometry", p_.odometry_inputs(f, r), p_.odometry_products(r),
                    [&] { find_map(e_, f.folder / "dataset", r, progress_); });
        require_map(r, f.folder / "dataset");
      });
    }
  }

  void align_and_score(const FlightStages& f) const {
    for (const OdometryRun& r : p_.runs(f)) {
      if (!cache_.has(r.name + "/odometry")) continue;  // a further run that failed
      attempt(r, [&] {
        require_map(r, f.folder / "dataset");
        MapInputs map = map_inputs(r.folder / "odometry", f.folder / "dataset");
        map.others = p_.maps_of_others(f);
        const fs::path transform = r.folder / "transform.json";
        cache_.once(r.name + "/alignment", p_.alignment_inputs(f, r), {r.name + "/transform.json"},
                    [&] { align(map, folder_ / "truth", e_.alignment, transform, progress_); });
        cache_.once(r.name + "/evaluation", p_.evaluation_inputs(r), p_.evaluation_products(r), [&] {
          evaluate(map, folder_ / "truth", transform, e_.evaluation, r.folder / "metrics.json", progress_);
        });
      });
    }
  }

 private:
  const Experiment& e_;
  const Pipeline& p_;
  StageCache& cache_;
  fs::path folder_;
  const Progress& progress_;
};

/// Hears a variant's stages by its name.
StageListener listener_of(const Variant& variant, const StageListener& listener) {
  if (!listener) return {};
  return [&variant, &listener](StageNews news) {
    news.stage = "variants/" + variant.name + "/" + news.stage;
    listener(news);
  };
}

}  // namespace

// The pipeline. A stage is skipped when its inputs (the settings, the files' contents, the keys of the stages before
// it) are those that it was done with.
nlohmann::json run(const Experiment& e, const fs::path& folder, const Progress& progress, const RunOptions& options) {
  const RunFolder own(folder);
  if (options.again) forget_stages(folder);
  StageCache cache(folder, program_fingerprint(), own.file_hashes(), options.listener);
  const Pipeline p(e, folder, cache);

  if (p.uses_built_in_place()) cache.once("place", p.place_inputs(), {"place"}, [&] { p.make_place(progress); });
  cache.once("truth", p.truth_inputs(), {"truth"},
             [&] { extract(p.extract_settings(), folder / "truth", true, progress); });

  const FlightWork flight(e, p, cache, progress);
  const bool follows = p.simulated_follows_real();
  for (const FlightStages& f : p.flights()) {
    flight.film(f);
    flight.track(f);
    if (follows) flight.align_and_score(f);  // the flight that follows needs to know where
  }
  // Regions to align on want the points of both.
  if (!follows) std::ranges::for_each(p.flights(), [&](const FlightStages& f) { flight.align_and_score(f); });
  if (follows) {
    cache.once("reproduction", p.reproduction_inputs(), {"reproduction.json", "reproduction.csv"},
               [&] { measure_reproduction(folder, progress); });
  }
  if (e.simulated && e.real) {
    cache.once("comparison", p.comparison_inputs(), {"comparison.json"}, [&] {
      const json c = compare(scored(p.runs_of("simulated")), scored(p.runs_of("real")), e.evaluation, e.seed);
      geometry::write_file(folder / "comparison.json", c.dump(2) + "\n");
    });
    cache.once("failure", p.failure_inputs(), {"failure.json"},
               [&] { predict_failure(folder, e.evaluation, follows, e.seed); });
  }
  json results = collect_results(e, p, cache);
  if (!e.variants.empty()) {
    results["ablation"] =
        fly_variants(e.variants, results, folder, [&](const Variant& variant, const fs::path& its_folder) {
          return run(p.variant_of(variant), its_folder, progress, {.listener = listener_of(variant, options.listener)});
        });
  }
  geometry::write_file(folder / "results.json", results.dump(2) + "\n");
  cache.once("report", {{"results", geometry::sha256_hex(results.dump())}},
             {"report.html", "report.json", "tables/key-figures.csv", "tables/key-figures.tex"},
             [&] { report::write_report(folder); });
  return results;
}

}  // namespace tileflight::experiment
