#include "tileflight/experiments/study/study_results.h"

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/warning.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/experiments/study/run_survival.h"
#include "tileflight/experiments/study/study_page.h"
#include "tileflight/experiments/study/study_ranking.h"
#include "tileflight/experiments/study/study_tables.h"
#include "tileflight/experiments/study/system_comparison.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr const char* kNotRunYet = "not run yet";
constexpr const char* kNotScoredYet = "not scored yet";

json at(const json& object, const char* pointer) {
  const json::json_pointer where(pointer);
  return object.contains(where) ? object.at(where) : json(nullptr);
}

/// A threshold as metrics.json writes it, "0.2".
std::string threshold_key(double threshold_m) { return base::fixed_text(threshold_m); }

std::string first_line(const fs::path& file) {
  const std::string text = base::read_text(file);
  return text.substr(0, text.find('\n'));
}

/// Copies the results that the run of the system recorded itself.
void add_system_results(const json& odometry, json& run) {
  const json& system = odometry.at("system");
  run["applicable"] = system.at("applicable");
  run["completed"] = system.at("completed");
  run["reason"] = system.at("reason");
  run["version"] = at(system, "/version");
  run["frames"] = odometry.at("frames");
  run["frames_tracked"] = odometry.at("frames_tracked");
  run["points"] = odometry.at("points");
  for (const char* key : {"seconds", "cpu_seconds", "peak_memory_mb", "exit_status", "visible_share", "handed_lens",
                          "lens", "notes", "threads"})
    run[key] = at(system, ("/" + std::string(key)).c_str());
}

/// Whether an error or a warning says that the map may lie in a wrong place.
bool has_uncertain_place(const json& warnings) {
  return std::ranges::any_of(warnings, [](const json& warning) {
    return warning.at("where") == "alignment" &&
           (warning.at("severity") == "error" || warning.at("severity") == "warning");
  });
}

void add_scores(const json& metrics, double threshold_m, json& run) {
  const std::string threshold = threshold_key(threshold_m);
  run["ate_rmse"] = at(metrics, "/trajectory/ate_rmse");
  run["path_length"] = at(metrics, "/trajectory/path_length");
  for (const char* share : {"accuracy", "completeness", "f_score"})
    run[share] = at(metrics, ("/surface/" + std::string(share) + "/" + threshold).c_str());
  run["surface_median"] = at(metrics, "/surface/median");
  run["awd"] = at(metrics, "/wasserstein/awd");
  run["scs"] = at(metrics, "/wasserstein/scs");
  run["alignment_metres"] = at(metrics, "/error_budget/alignment/metres");
  run["warnings"] = metrics.value("warnings", json::array());
  run["place_uncertain"] = has_uncertain_place(run["warnings"]);
  if (run["place_uncertain"] == false) return;
  // A map that shrank onto the surface, or lies on another part of it, is near it: that tells nothing of the map. The
  // F-score stays: of the surface that the camera saw, such a map covers nothing.
  for (const char* key : {"surface_median", "accuracy", "completeness", "awd", "scs"}) run[key] = nullptr;
}

json describe_run(const fs::path& folder, const json& plan, const json& planned) {
  const json& flight = plan.at("flights").at(planned.at("flight").get<std::size_t>());
  json run{{"system", planned.at("system")},
           {"place", flight.at("place")},
           {"site", flight.value("site", flight.at("place"))},
           {"kind", flight.value("kind", std::string())},
           {"camera", flight.at("camera")},
           {"flight", flight.at("flight")},
           {"repetition", planned.at("repetition")},
           {"seed", planned.at("seed")},
           {"folder", planned.at("folder")},
           {"dataset", flight.at("dataset")},
           {"applicable", true},
           {"completed", false},
           {"reason", kNotRunYet}};
  for (const char* key : {"frames", "frames_tracked", "ate_rmse", "accuracy", "completeness", "f_score", "seconds",
                          "cpu_seconds", "peak_memory_mb", "surface_median", "alignment_metres"})
    run[key] = nullptr;
  run["warnings"] = json::array();
  run["place_uncertain"] = false;
  const fs::path place = folder / planned.at("folder").get<std::string>();
  if (!fs::exists(place / "odometry/odometry.json")) return run;
  add_system_results(base::read_json(place / "odometry/odometry.json"), run);
  if (const fs::path file = place / "metrics.json"; fs::exists(file)) {
    const json metrics = base::read_json(file);
    refuse_earlier_key(metrics, file);
    add_scores(metrics, plan.at("threshold_m"), run);
  }
  const std::string fault = fs::exists(place / "scores.txt") ? first_line(place / "scores.txt") : kNotScoredYet;
  run["not_scored"] = fault;
  if (run["completed"] == true && !fault.empty()) run["reason"] = fault;
  return run;
}

bool is_installed(const json& plan, const json& run) {
  return plan.at("systems").at(run.at("system").get<std::string>()).at("installed");
}

/// Share of the dataset's frames that have a pose.
double tracked_share(const json& run) {
  const double frames = run.at("frames").get<double>();
  return frames > 0.0 ? std::min(1.0, run.at("frames_tracked").get<double>() / frames) : 0.0;
}

/// 0 for a run that failed, or whose map or path cannot be registered; none where there is nothing to score it by. A
/// frame without a pose scores nothing: the path's error is that of the others, and three poses always fit.
std::optional<double> score_of(const json& run, const json& plan) {
  const bool by_path = plan.at("rank_by") == "ate";
  const bool makes_map = plan.at("systems").at(run.at("system").get<std::string>()).at("map");
  if (run.at("applicable") == false || !is_installed(plan, run) || (!by_path && !makes_map)) return std::nullopt;
  if (run.at("reason") == kNotRunYet) return std::nullopt;
  if (run.at("completed") == false) return 0.0;
  const json& value = run.at(by_path ? "ate_rmse" : "f_score");
  const std::string fault = run.at("not_scored");
  if (value.is_null()) return fault.empty() || fault == kNotScoredYet ? std::nullopt : std::optional(0.0);
  if (!by_path) return value.get<double>();
  return tracked_share(run) * std::max(0.0, 1.0 - value.get<double>() / plan.at("ate_limit_m").get<double>());
}

std::vector<ScoredRun> scored_runs(json& runs, const json& plan) {
  std::vector<ScoredRun> scored;
  for (json& run : runs) {
    const std::optional<double> score = score_of(run, plan);
    run["score"] = score ? json(*score) : json(nullptr);
    scored.push_back({.system = run.at("system"),
                      .place = run.at("site"),
                      .flight = run.at("place").get<std::string>() + "/" + run.at("camera").get<std::string>() + "/" +
                                run.at("flight").get<std::string>(),
                      .kind = run.at("kind"),
                      .is_simulated = run.at("flight") == "simulated",
                      .score = score});
  }
  return scored;
}

/// True paths of flights, each read once.
class TruePaths {
 public:
  explicit TruePaths(fs::path folder) : folder_(std::move(folder)) {}

  /// Returns nullptr if the dataset is not there or has no true poses.
  const geometry::Trajectory* of(const std::string& dataset) {
    auto found = read_.find(dataset);
    if (found == read_.end()) found = read_.emplace(dataset, read(folder_ / dataset)).first;
    return found->second ? &*found->second : nullptr;
  }

 private:
  static std::optional<geometry::Trajectory> read(const fs::path& dataset) {
    try {
      return dataset::read_dataset(dataset).groundtruth;
    } catch (const InputError&) {
      return std::nullopt;  // not made yet, or no longer there
    }
  }

  fs::path folder_;
  std::map<std::string, std::optional<geometry::Trajectory>> read_;
};

/// Measures how far a run came. Returns nullopt if it was not made or no true path is known. A crashed system counts up
/// to the end of its path.
std::optional<RunSurvival> survival_of(const json& run, const json& plan, const fs::path& folder, TruePaths& truths) {
  if (run.at("applicable") == false || !is_installed(plan, run) || run.at("reason") == kNotRunYet) return std::nullopt;
  const geometry::Trajectory* truth = truths.of(run.at("dataset"));
  if (truth == nullptr) return std::nullopt;
  const fs::path path = folder / run.at("folder").get<std::string>() / "odometry/trajectory.txt";
  if (!fs::exists(path)) return RunSurvival{.failed = true, .reason = run.at("reason")};
  try {
    RunSurvival survived = measure_survival(geometry::read_tum(path), *truth);
    if (run.at("completed") == false && !survived.failed) survived.failed = true, survived.reason = run.at("reason");
    return survived;
  } catch (const InputError& error) {
    return RunSurvival{.failed = true, .reason = error.what()};
  }
}

/// Survival curves by system. Adds `survived` to each run.
json survival(json& runs, const json& plan, const fs::path& folder) {
  TruePaths truths(folder);
  std::map<std::string, std::vector<RunSurvival>> by_system;
  for (json& run : runs) {
    run["survived"] = nullptr;
    const std::optional<RunSurvival> one = survival_of(run, plan, folder, truths);
    if (!one) continue;
    run["survived"] = {{"distance", one->distance_m}, {"failed", one->failed}, {"reason", one->reason}};
    by_system[run.at("system")].push_back(*one);
  }
  json result = json::object();
  for (const auto& [system, survived] : by_system) {
    const auto furthest = std::ranges::max_element(survived, {}, &RunSurvival::distance_m);
    result[system] = {{"runs", survived.size()},
                      {"failed", std::ranges::count_if(survived, &RunSurvival::failed)},
                      {"furthest", furthest->distance_m},
                      {"curve", to_json(survival_curve(survived))}};
  }
  return result;
}

/// Runs, failures and lost frames of each system.
json robustness(const json& runs, const json& plan) {
  json result = json::object();
  for (const json& run : runs) {
    json& system = result[run.at("system").get<std::string>()];
    if (system.is_null())
      system = {{"runs", 0},    {"failed", 0}, {"not_applicable", 0},
                {"not_run", 0}, {"frames", 0}, {"frames_tracked", 0}};
    const bool was_run = is_installed(plan, run) && run.at("reason") != kNotRunYet;
    if (run.at("applicable") == false || !was_run) {
      json& count = system[run.at("applicable") == false ? "not_applicable" : "not_run"];
      count = count.get<int>() + 1;
      continue;
    }
    system["runs"] = system["runs"].get<int>() + 1;
    if (run.at("completed") == false) system["failed"] = system["failed"].get<int>() + 1;
    for (const char* key : {"frames", "frames_tracked"})
      if (run.at(key).is_number()) system[key] = system[key].get<std::int64_t>() + run.at(key).get<std::int64_t>();
  }
  return result;
}

/// Why none of the completed runs has scores, if that is so: the fault is then hardly the systems'.
std::string why_nothing_is_scored(const json& runs) {
  std::string reason;
  for (const json& run : runs) {
    if (run.at("completed") == false) continue;
    const std::string fault = run.at("not_scored");
    if (fault.empty()) return "";
    if (reason.empty()) reason = fault;
  }
  return reason;
}

/// By system: number of scored maps, and of those whose place is uncertain.
std::map<std::string, std::pair<int, int>> count_uncertain_places(const json& runs) {
  std::map<std::string, std::pair<int, int>> counts;
  for (const json& run : runs) {
    if (run.at("f_score").is_null()) continue;
    auto& [scored, uncertain] = counts[run.at("system")];
    ++scored;
    if (run.at("place_uncertain") == true) ++uncertain;
  }
  return counts;
}

/// Returns the warnings about the ranking.
json ranking_warnings(const json& plan, const json& runs, const std::vector<RankedSystem>& ranking,
                      const std::vector<SystemDifference>& differences) {
  json warnings = json::array();
  const auto add = [&](const std::string& what, const std::string& remedy) {
    warnings.push_back({{"message", what}, {"where", "ranking"}, {"severity", "error"}, {"remedy", remedy}});
  };
  if (const std::string fault = why_nothing_is_scored(runs); !fault.empty())
    add("no run could be scored: " + fault, "mend that, and start the study again");
  std::size_t places = 0, flights = 0;
  for (const RankedSystem& system : ranking) {
    places = std::max(places, system.places);
    flights = std::max(flights, system.flights);
  }
  if (places < 5)
    add("the ranking rests on " + std::to_string(places) + (places == 1 ? " place" : " places") +
            ": on another place the order may be another",
        "add places");
  if (const std::size_t fewest = fewest_places_to_show(differences.size()); !differences.empty() && places < fewest)
    add("no difference between systems can be shown by " + std::to_string(places) +
            (places == 1 ? " place" : " places") + ": " + std::to_string(differences.size()) +
            (differences.size() == 1 ? " comparison needs" : " comparisons need") + " at least " +
            std::to_string(fewest),
        "add places, or leave out systems");
  for (const RankedSystem& system : ranking) {
    if (system.score && system.flights < flights)
      add(system.system + " is judged by " + std::to_string(system.flights) + " of " + std::to_string(flights) +
              " flights, those it can run on",
          "compare it on these flights only");
  }
  for (const auto& [name, count] : count_uncertain_places(runs)) {
    if (count.second > 0)
      add(std::to_string(count.second) + " of " + std::to_string(count.first) + " maps of " + name +
              " may lie in a wrong place, by the warnings of their registration: their distances to the surface are "
              "not "
              "shown, their scores count as they are",
          "see `warnings` of these runs in study.json");
  }
  for (const auto& [name, system] : plan.at("systems").items()) {
    if (system.at("installed") == false)
      add(name + " was not run: " + system.at("missing").get<std::string>(), "install it, and start the study again");
  }
  return warnings;
}

}  // namespace

bool is_study_folder(const fs::path& folder) { return fs::exists(folder / "plan.json"); }

json collect_study(const fs::path& folder) {
  if (!is_study_folder(folder)) throw InputError(folder.string(), "is no folder of `tileflight study`");
  const json plan = base::read_json(folder / "plan.json");
  json runs = json::array();
  for (const json& planned : plan.at("runs")) runs.push_back(describe_run(folder, plan, planned));
  const std::vector<ScoredRun> scored = scored_runs(runs, plan);
  const std::vector<RankedSystem> ranking = rank_systems(scored);
  const std::optional<RankAgreement> agreement = compare_ranks(scored, plan.at("seed"));
  const std::vector<SystemDifference> differences = compare_systems(scored, plan.at("seed"));
  json by_kind = json::object();
  for (const auto& [kind, of_kind] : compare_ranks_by_kind(scored, plan.at("seed"))) by_kind[kind] = to_json(of_kind);
  const json survived = survival(runs, plan, folder);  // before `runs` are copied
  return {{"name", plan.at("name")},
          {"rank_by", plan.at("rank_by")},
          {"threshold_m", plan.at("threshold_m")},
          {"ate_limit_m", plan.at("ate_limit_m")},
          {"repetitions", plan.at("repetitions")},
          {"systems", plan.at("systems")},
          {"flights", plan.at("flights")},
          {"except", plan.at("except")},
          {"runs", runs},
          {"robustness", robustness(runs, plan)},
          {"ranking", to_json(ranking)},
          {"differences", to_json(differences)},
          {"survival", survived},
          {"kendall_tau", agreement ? to_json(*agreement) : json(nullptr)},
          {"kendall_tau_by_kind", by_kind},
          {"warnings", ranking_warnings(plan, runs, ranking, differences)}};
}

json write_study_report(const fs::path& folder) {
  const json study = collect_study(folder);
  base::write_file(folder / "study.json", study.dump(2) + "\n");
  write_study_tables(study, folder / "tables");
  base::write_file(folder / "study.html", study_page(study, folder));
  return study;
}

}  // namespace tileflight::study
