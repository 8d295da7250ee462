#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/jobs/run_tasks.h"
#include "tileflight/experiments/study/study_file.h"

namespace tileflight::study {

/// A flight over a place through a camera, on which all systems run.
struct StudyFlight {
  std::string place, camera, flight;  ///< camera: empty for the flight's own
  std::string place_folder;           ///< PLACES/NAME-HASH, as written in the tasks; empty: a dataset from elsewhere
  std::string dataset;                ///< folder of its images, as written in the tasks
  std::string site, kind;             ///< of StudyPlace
  std::string id() const;             ///< "stadium/simulated", "stadium-wide/simulated"
};

/// One run of one system on one flight.
struct StudyRun {
  std::size_t flight = 0;  ///< index into StudyPlan::flights
  std::string system;
  int repetition = 1;  ///< from 1
  std::uint64_t seed = 1;
  std::string folder;  ///< "runs/stadium/simulated/colmap/1"
};

/// Limits of the machine that a plan is made for.
struct PlanOptions {
  std::filesystem::path out;     ///< the study's folder
  std::filesystem::path places;  ///< folder of the places, shared by studies; empty: OUT/places
  int jobs = 1;                  ///< tasks at once
  int cores = 1;                 ///< of the machine; each task has cores / jobs threads
};

/// The product of places, flights, cameras, systems and repetitions, less the exceptions, as tasks.
struct StudyPlan {
  StudyFile study;
  std::vector<StudyFlight> flights;
  std::vector<StudyRun> runs;
  std::vector<jobs::Task> tasks;  ///< in an order that respects their inputs
};

/// Makes the tasks of a study. Throws InputError for a broken experiment.
StudyPlan make_plan(const StudyFile& study, const PlanOptions& options);

/// Returns {places, flights, systems {name: {title, installed, missing, version}}, runs, tasks, repetitions} for
/// --dry-run.
nlohmann::json describe_plan(const StudyPlan& plan);
/// Returns the description of a plan as text.
std::string plan_text(const StudyPlan& plan);

/// Writes the plan into the study's folder as a Snakemake workflow (Snakefile, tasks/, plan.json), starts it, and
/// returns study.json. Tasks whose inputs have not changed are skipped, also after a crash. Without
/// Snakemake the tasks run one after the other. Throws InputError if a task failed (naming it and its log), if another
/// process works in the folder, and if Slurm is wanted without Snakemake.
nlohmann::json run_study(const StudyPlan& plan, const PlanOptions& folders, const jobs::TaskOptions& options,
                         const Progress& progress = {});

}  // namespace tileflight::study
