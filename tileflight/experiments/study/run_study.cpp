#include "tileflight/experiments/study/run_study.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/program.h"
#include "tileflight/core/jobs/build_folder.h"
#include "tileflight/core/jobs/run_tasks.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/file_hash_cache.h"
#include "tileflight/experiments/experiment/results.h"
#include "tileflight/experiments/study/study_results.h"

namespace tileflight::study {

namespace fs = std::filesystem;
namespace {

using base::shell_word;
using jobs::marker_of;
using jobs::Task;
using nlohmann::json;

/// Hash of the files below a folder, by name and content.
std::string folder_hash(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files[entry.path().lexically_relative(folder)] = base::sha256_hex_of_file(entry.path());
  }
  std::string all;
  for (const auto& [name, hash] : files) all += name + " " + hash + "\n";
  return base::sha256_hex(all);
}

bool is_excluded(const StudyFile& study, const StudyFlight& flight, const std::string& system) {
  const auto fits = [](const std::string& named, const std::string& name) { return named.empty() || named == name; };
  return std::ranges::any_of(study.exceptions, [&](const StudyException& e) {
    return fits(e.place, flight.place) && fits(e.camera, flight.camera) && fits(e.flight, flight.flight) &&
           fits(e.system, system);
  });
}

/// Makes the tasks of a plan.
class TaskMaker {
 public:
  explicit TaskMaker(const PlanOptions& options)
      : options_(options),
        threads_(std::max(1, options.cores / std::max(1, options.jobs))),
        program_(base::program_path()),
        fingerprint_(base::program_fingerprint()),
        dataset_hashes_(fs::exists(options.out) ? options.out / ".file-hashes" : fs::path()) {}

  /// Keeps the hashes of datasets for the next start of the study.
  void save_hashes() const { dataset_hashes_.save(); }

  /// Folder of a place's truth and datasets, named by all that they come from: studies with the same place share it.
  std::string place_folder(const StudyPlace& place, const StudyCamera& camera) const {
    const experiment::Experiment experiment = experiment::read_experiment(place.experiment);
    std::string content = std::to_string(experiment.seed);
    for (const char* section : {"place", "truth", "simulated", "real", "odometry", "alignment"}) {
      const auto text = experiment.sections.find(section);
      content += "\n" + std::string(section) + " " + (text == experiment.sections.end() ? "" : text->second);
    }
    std::vector<fs::path> files = experiment::input_files(experiment);
    files.erase(files.begin());  // the experiment itself: its sections count, not its comments
    if (!camera.calibration.empty()) files.push_back(camera.calibration);
    for (const fs::path& file : files) {
      if (fs::is_regular_file(file)) content += "\n" + base::sha256_hex_of_file(file);
    }
    const std::string name = place.name + (camera.name.empty() ? "" : "-" + camera.name);
    return places_folder() / (name + "-" + base::sha256_hex(content).substr(0, 8));
  }

  fs::path places_folder() const {
    return (options_.places.empty() ? fs::path("places") : fs::absolute(options_.places)).lexically_normal();
  }

  Task place_task(const StudyPlace& place, const StudyCamera& camera, const std::string& folder) const {
    std::ostringstream script;
    script << "\"$TILEFLIGHT\" run " << shell_word(fs::absolute(place.experiment).lexically_normal())
           << " --until datasets";
    for (const std::string& flight : place.flights) script << " --flight " << flight;
    if (!camera.calibration.empty())
      script << " --camera " << shell_word(fs::absolute(camera.calibration).lexically_normal());
    // Other cameras' and flights' folders of the place have the same truth, and the same built-in place.
    script << " --truth-cache " << shell_word((places_folder() / "truths").string()) << " --threads " << threads_
           << " --quiet --out " << shell_word(folder) << "\n";
    return finished({.name = place_task_name(folder)}, script.str(), "");
  }

  Task system_task(const StudyFlight& flight, const StudyRun& run, const StudySystem& system) const {
    const bool was_recorded_elsewhere = flight.place_folder.empty();
    Task task{.name = task_name("system", run)};
    if (!was_recorded_elsewhere) task.inputs.push_back(marker_of(place_task_name(flight.place_folder)));
    std::ostringstream script;
    script << "mkdir -p " << shell_word(run.folder) << "\n"
           << "rm -rf " << shell_word(run.folder + "/odometry") << "\n"
           << "# Exit status 1: the system failed, which is a result and stands in odometry.json.\n"
           << "\"$TILEFLIGHT\" odometry " << shell_word(flight.dataset) << " --system "
           << shell_word(adapter_word(system)) << " --seed " << run.seed;
    if (system.time_limit_s > 0.0) script << " --time-limit " << base::fixed_text(system.time_limit_s);
    if (system.memory_limit_gb > 0.0) script << " --memory-limit " << base::fixed_text(system.memory_limit_gb);
    script << " --threads " << threads_ << " --quiet --force --out " << shell_word(run.folder + "/odometry")
           << " || [ $? -eq 1 ]\n"
           << "test -f " << shell_word(run.folder + "/odometry/odometry.json") << "\n";
    if (system.time_limit_s > 0.0) task.minutes = 10 + static_cast<int>(system.time_limit_s / 60.0);
    if (system.memory_limit_gb > 0.0) task.memory_mb = 2000 + static_cast<int>(1000.0 * system.memory_limit_gb);
    const std::string recorded = was_recorded_elsewhere ? dataset_hashes_.hash(flight.dataset) : "";
    return finished(task, script.str(), folder_hash(system.adapter.folder), recorded);
  }

  /// Adds the commands that score a run: by its map over a place, or by the path of a system without a map. On a
  /// dataset from elsewhere it is scored by its path.
  Task score_task(const StudyFlight& flight, const StudyRun& run) const {
    const Task task{.name = task_name("score", run), .inputs = {marker_of(task_name("system", run)), "settings.yaml"}};
    const std::string map = shell_word(run.folder + "/odometry"), with = shell_word(flight.dataset);
    const std::string to = shell_word(flight.place_folder + "/truth");
    const std::string transform = shell_word(run.folder + "/transform.json");
    const std::string metrics = shell_word(run.folder + "/metrics.json"), log = shell_word(run.folder + "/scores.part");
    const std::string common = " --settings settings.yaml --threads " + std::to_string(threads_) + " --quiet --force";
    std::ostringstream script;
    script << "rm -f " << transform << " " << metrics << "\n"
           << "# Exit status 1: the map or path cannot be scored, which is a result; why stands in scores.txt.\n"
           << "{\n";
    if (flight.place_folder.empty()) {
      script << "  if [ -f " << map << "/trajectory.txt ]; then\n    " << path_score(map, with, metrics) << "  fi\n";
    } else {
      script << "  if [ -f " << map << "/map.ply ]; then\n"
             << "    \"$TILEFLIGHT\" align " << map << " --to " << to << " --dataset " << with << common << " --out "
             << transform << " &&\n"
             << "    \"$TILEFLIGHT\" evaluate " << map << " --truth " << to << " --dataset " << with << " --transform "
             << transform << common << " --out " << metrics << "\n"
             << "  elif [ -f " << map << "/trajectory.txt ] && [ -f " << with << "/groundtruth.txt ]; then\n"
             << "    " << path_score(map, with + "/groundtruth.txt", metrics) << "  fi\n";
    }
    script << "} 2> " << log << " || [ $? -eq 1 ]\n"
           << "mv " << log << " " << shell_word(run.folder + "/scores.txt") << "\n";
    return finished(task, script.str(), "");
  }

  Task report_task(const std::vector<StudyRun>& runs) const {
    Task task{.name = "report", .inputs = {"plan.json"}};
    for (const StudyRun& run : runs) task.inputs.push_back(marker_of(task_name("score", run)));
    return finished(task, "\"$TILEFLIGHT\" report . --quiet\n", "");
  }

 private:
  static std::string place_task_name(const std::string& folder) {
    return "place-" + fs::path(folder).filename().string();
  }
  /// The command that scores a path alone; all are words of the shell.
  static std::string path_score(const std::string& map, const std::string& truth, const std::string& metrics) {
    return "\"$TILEFLIGHT\" evaluate --trajectory " + map + "/trajectory.txt --truth-trajectory " + truth +
           " --quiet --force --out " + metrics + "\n";
  }
  static std::string task_name(const std::string& what, const StudyRun& run) {
    std::string name = what + run.folder.substr(std::string("runs").size());
    std::ranges::replace(name, '/', '.');
    return name;
  }
  static std::string adapter_word(const StudySystem& system) { return system.adapter.folder; }

  /// Adds what all scripts have. A change of the program, of `version` (an adapter's) or of `recorded` (a dataset's
  /// content) changes the script, so that the task is done again.
  Task finished(Task task, const std::string& work, const std::string& version,
                const std::string& recorded = "") const {
    task.threads = threads_;
    task.script = "#!/bin/sh\n# To be run in the study's folder.\n# program " + fingerprint_.substr(0, 16) +
                  (version.empty() ? "" : ", adapter " + version.substr(0, 16)) +
                  (recorded.empty() ? "" : ", dataset " + recorded.substr(0, 16)) +
                  "\nset -e\n: \"${TILEFLIGHT:=" + program_.string() + "}\"\n" + work + "touch " +
                  shell_word(marker_of(task.name)) + "\n";
    task.inputs.push_back("tasks/" + task.name + ".sh");
    task.outputs = {marker_of(task.name)};
    return task;
  }

  const PlanOptions& options_;
  int threads_;
  fs::path program_;
  std::string fingerprint_;
  experiment::FileHashCache dataset_hashes_;
};

void add_runs(const StudyFile& study, const TaskMaker& make, std::size_t flight, StudyPlan& plan) {
  const StudyFlight& on = plan.flights[flight];
  for (const StudySystem& system : study.systems) {
    if (is_excluded(study, on, system.name)) continue;
    for (int repetition = 1; repetition <= study.repetitions; ++repetition) {
      const StudyRun run{.flight = flight,
                         .system = system.name,
                         .repetition = repetition,
                         .seed = study.seed + static_cast<std::uint64_t>(repetition - 1),
                         .folder = "runs/" + on.id() + "/" + system.name + "/" + std::to_string(repetition)};
      plan.tasks.push_back(make.system_task(on, run, system));
      plan.tasks.push_back(make.score_task(on, run));
      plan.runs.push_back(run);
    }
  }
}

}  // namespace

std::string StudyFlight::id() const { return place + (camera.empty() ? "" : "-" + camera) + "/" + flight; }

StudyPlan make_plan(const StudyFile& study, const PlanOptions& options) {
  StudyPlan plan{.study = study, .flights = {}, .runs = {}, .tasks = {}};
  const TaskMaker make(options);
  for (const StudyPlace& place : study.places) {
    for (const auto& [name, folder] : place.datasets) {
      plan.flights.push_back({.place = place.name,
                              .camera = {},
                              .flight = name,
                              .place_folder = {},
                              .dataset = folder.string(),
                              .site = place.site,
                              .kind = place.kind});
      add_runs(study, make, plan.flights.size() - 1, plan);
    }
    if (!place.datasets.empty()) continue;
    for (const StudyCamera& camera : study.cameras) {
      const std::string folder = make.place_folder(place, camera);
      plan.tasks.push_back(make.place_task(place, camera, folder));
      for (const std::string& flight : place.flights) {
        plan.flights.push_back(
            {place.name, camera.name, flight, folder, folder + "/" + flight + "/dataset", place.site, place.kind});
        add_runs(study, make, plan.flights.size() - 1, plan);
      }
    }
  }
  if (plan.runs.empty()) throw InputError(study.file.string(), "has exceptions that leave nothing to run");
  plan.tasks.push_back(make.report_task(plan.runs));
  make.save_hashes();
  return plan;
}

json describe_plan(const StudyPlan& plan) {
  json systems = json::object();
  for (const StudySystem& system : plan.study.systems) {
    const std::string missing = external_systems::why_not_installed(system.adapter);
    systems[system.name] = {{"title", system.adapter.title},
                            {"adapter", system.adapter.folder.string()},
                            {"version", external_systems::installed_version(system.adapter)},
                            {"installed", missing.empty()},
                            {"missing", missing},
                            {"map", !system.adapter.map.empty()}};
  }
  json flights = json::array(), runs = json::array();
  for (const StudyFlight& flight : plan.flights) {
    flights.push_back({{"id", flight.id()},
                       {"place", flight.place},
                       {"site", flight.site},
                       {"kind", flight.kind},
                       {"camera", flight.camera},
                       {"flight", flight.flight},
                       {"folder", flight.place_folder},
                       {"dataset", flight.dataset}});
  }
  for (const StudyRun& run : plan.runs) {
    runs.push_back({{"flight", run.flight},
                    {"system", run.system},
                    {"repetition", run.repetition},
                    {"seed", run.seed},
                    {"folder", run.folder}});
  }
  json left_out = json::array();
  for (const StudyException& e : plan.study.exceptions) {
    left_out.push_back(
        {{"place", e.place}, {"camera", e.camera}, {"flight", e.flight}, {"system", e.system}, {"reason", e.reason}});
  }
  return {{"name", plan.study.name},
          {"seed", plan.study.seed},
          {"repetitions", plan.study.repetitions},
          {"rank_by", plan.study.rank_by},
          {"threshold_m", plan.study.threshold_m},
          {"ate_limit_m", plan.study.ate_limit_m},
          {"systems", systems},
          {"flights", flights},
          {"runs", runs},
          {"except", left_out},
          {"tasks", plan.tasks.size()}};
}

std::string plan_text(const StudyPlan& plan) {
  std::ostringstream text;
  text << plan.study.name << ": " << plan.flights.size() << " flights, " << plan.study.systems.size() << " systems, "
       << plan.study.repetitions << " repetitions: " << plan.runs.size() << " runs in " << plan.tasks.size()
       << " tasks\n";
  for (const StudyFlight& flight : plan.flights)
    text << "  flight " << flight.id() << " (" << (flight.place_folder.empty() ? flight.dataset : flight.place_folder)
         << ")\n";
  for (const StudySystem& system : plan.study.systems) {
    const std::string missing = external_systems::why_not_installed(system.adapter);
    text << "  system " << system.name << ": " << system.adapter.title
         << (missing.empty() ? "" : ", not installed: " + missing) << "\n";
  }
  for (const StudyException& e : plan.study.exceptions) {
    text << "  left out:";
    for (const std::string& word : {e.place, e.camera, e.flight, e.system}) text << (word.empty() ? "" : " " + word);
    text << " (" << e.reason << ")\n";
  }
  return text.str();
}

namespace fs = std::filesystem;
namespace {

using nlohmann::json;

void write_plan(const StudyPlan& plan, const fs::path& folder) {
  jobs::write_if_changed(folder / "study.yaml", base::read_text(plan.study.file));
  jobs::write_if_changed(folder / "settings.yaml", "# For align and evaluate.\n" + plan.study.settings);
  jobs::write_if_changed(folder / "plan.json", describe_plan(plan).dump(2) + "\n");
  jobs::write_tasks(plan.tasks, folder, "tileflight study");
}

}  // namespace

json run_study(const StudyPlan& plan, const PlanOptions& folders, const jobs::TaskOptions& options,
               const Progress& progress) {
  if (fs::exists(folders.out) && !fs::is_empty(folders.out) && !is_study_folder(folders.out))
    throw InputError(folders.out.string(), "holds something else than a study; choose another folder for --out");
  base::make_folder(folders.out);
  const jobs::FolderLock lock(folders.out);
  write_plan(plan, folders.out);
  jobs::TaskOptions on_cores = options;
  on_cores.cores = folders.cores;
  jobs::run_tasks(plan.tasks, folders.out, on_cores, progress);
  return write_study_report(folders.out);
}

}  // namespace tileflight::study
