#include "tileflight/experiments/study/study_file.h"

#include <algorithm>
#include <cctype>

#include "tileflight/core/base/document_value.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/experiments/experiment/experiment_file.h"
#include "tileflight/experiments/experiment/stage_options.h"

namespace tileflight::study {
namespace fs = std::filesystem;
namespace {

using base::StrictSection;

/// Names become parts of paths and of tasks' names.
void require_name(const StrictSection& section, const std::string& key, const std::string& name) {
  const bool fits = !name.empty() && std::ranges::all_of(name, [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '-' || c == '_';
  });
  if (!fits) throw section.error(key, "has the name '" + name + "'; names hold letters, digits, '-' and '_'");
}

std::vector<std::string> flights_of(const fs::path& file) {
  const experiment::Experiment experiment = experiment::read_experiment(file);
  std::vector<std::string> flights;
  if (experiment.simulated) flights.emplace_back("simulated");
  if (experiment.real) flights.emplace_back("real");
  return flights;
}

fs::path require_file(const StrictSection& section, const std::string& key, const fs::path& file) {
  if (!fs::exists(file)) throw section.error(key, "names " + file.string() + ", which does not exist");
  return file;
}

/// Sets the flights of a place that is its datasets, as they lie.
void read_datasets(StrictSection datasets, StudyPlace& place) {
  for (const std::string& flight : datasets.keys()) {
    require_name(datasets, flight, flight);
    const auto folder = datasets.path(flight);
    if (!folder) throw datasets.error(flight, "needs a dataset's folder");
    if (!dataset::read_dataset(require_file(datasets, flight, *folder)).groundtruth)
      throw datasets.error(flight, "names " + folder->string() + ", which has no true poses to score a path by");
    place.flights.push_back(flight);
    place.datasets[flight] = fs::absolute(*folder).lexically_normal();
  }
  if (place.flights.empty()) throw InputError(datasets.place(), "is empty: give at least one dataset's folder");
}

StudyPlace read_place(StrictSection& places, const std::string& name) {
  StudyPlace place{.name = name, .site = name, .kind = {}, .experiment = {}, .flights = {}, .datasets = {}};
  require_name(places, name, name);
  if (!places.is_map(name)) {
    const auto file = places.path(name);
    if (!file) throw places.error(name, "needs an experiment file, e.g. `" + name + ": experiment.yaml`");
    place.experiment = require_file(places, name, *file);
    place.flights = flights_of(place.experiment);
    return place;
  }
  StrictSection section = *places.section(name);
  section.ignore({"experiment", "flights"});  // keys here, also where they are left out
  place.site = section.text("site").value_or(name);
  place.kind = section.text("kind").value_or("");
  for (const auto& [key, word] : {std::pair("site", place.site), std::pair("kind", place.kind)}) {
    if (section.has(key)) require_name(section, key, word);
  }
  if (auto datasets = section.section("datasets")) {
    if (section.has("experiment"))
      throw section.error("datasets", "cannot be together with `experiment`: give each its own place");
    if (section.has("flights")) throw section.error("flights", "are those of `datasets`: name the wanted ones there");
    read_datasets(*datasets, place);
    section.require_all_keys_used();
    return place;
  }
  section.require("experiment");
  place.experiment = require_file(section, "experiment", section.path("experiment").value_or(""));
  place.flights = flights_of(place.experiment);
  if (section.has("flights")) {
    const std::vector<std::string> chosen = section.required_texts("flights");
    for (const std::string& flight : chosen) {
      if (std::ranges::count(chosen, flight) > 1) throw section.error("flights", "has '" + flight + "' twice");
      if (!std::ranges::count(place.flights, flight))
        throw section.error("flights", "has '" + flight + "', which is no flight of " + place.experiment.string());
    }
    if (chosen.empty()) throw section.error("flights", "is empty: leave it out for all flights");
    place.flights = chosen;
  }
  section.require_all_keys_used();
  return place;
}

std::vector<StudyPlace> read_places(StrictSection section) {
  std::vector<StudyPlace> places;
  for (const std::string& name : section.keys()) places.push_back(read_place(section, name));
  if (places.empty()) throw InputError(section.place(), "is empty: give at least one place");
  return places;
}

std::vector<StudyCamera> read_cameras(StrictSection& root) {
  std::vector<StudyCamera> cameras;
  if (auto section = root.section("cameras")) {
    for (const std::string& name : section->keys()) {
      require_name(*section, name, name);
      const auto file = section->path(name);
      if (!file) throw section->error(name, "needs a calibration file");
      cameras.push_back({name, require_file(*section, name, *file)});
    }
  }
  if (cameras.empty()) cameras.emplace_back();
  return cameras;
}

StudySystem read_system(const std::string& name, StrictSection section) {
  StudySystem system;
  system.name = name;
  std::string adapter = section.text("adapter").value_or(name);
  if (const auto folder = section.path("adapter"); folder && fs::exists(*folder / "adapter.yaml")) adapter = *folder;
  system.adapter = external_systems::find_adapter(adapter);
  system.time_limit_s = section.positive_number("time_limit").value_or(0.0);
  system.memory_limit_gb = section.positive_number("memory_limit").value_or(0.0);
  section.require_all_keys_used();
  return system;
}

std::vector<StudySystem> read_systems(StrictSection& root) {
  root.require("systems");
  std::vector<StudySystem> list;
  StrictSection section = root.required_section("systems");
  for (auto& [name, entry] : root.named_sections("systems")) {
    require_name(section, name, name);
    list.push_back(read_system(name, entry));
  }
  if (list.empty()) throw root.error("systems", "is empty: `tileflight systems` lists those there are");
  return list;
}

/// The word of an exception; an unknown one would exclude nothing.
std::string read_word(StrictSection& section, const std::string& key, const std::vector<std::string>& known) {
  const std::string word = section.text(key).value_or("");
  if (!word.empty() && !std::ranges::count(known, word))
    throw section.error(key, "is '" + word + "', which is not in this study" + base::did_you_mean(word, known));
  return word;
}

/// Names of all flights of a study, those that experiments can have first.
std::vector<std::string> flight_names(const std::vector<StudyPlace>& places) {
  std::vector<std::string> names{"simulated", "real"};
  for (const StudyPlace& place : places) {
    for (const auto& [flight, folder] : place.datasets) names.push_back(flight);
  }
  return names;
}

template <class Entry>
std::vector<std::string> names_of(const std::vector<Entry>& entries) {
  std::vector<std::string> names;
  for (const Entry& entry : entries) names.push_back(entry.name);
  return names;
}

std::vector<StudyException> read_exceptions(StrictSection& root, const StudyFile& study) {
  std::vector<StudyException> exceptions;
  for (StrictSection& section : root.sections("except")) {
    StudyException exception{.place = read_word(section, "place", names_of(study.places)),
                             .camera = read_word(section, "camera", names_of(study.cameras)),
                             .flight = read_word(section, "flight", flight_names(study.places)),
                             .system = read_word(section, "system", names_of(study.systems)),
                             .reason = section.text("reason").value_or("left out by the study")};
    section.require_all_keys_used();
    if (exception.place.empty() && exception.camera.empty() && exception.flight.empty() && exception.system.empty())
      throw InputError(section.place(), "excludes everything; name a place, camera, flight or system");
    exceptions.push_back(std::move(exception));
  }
  return exceptions;
}

/// Datasets have no surface that a map could be scored against.
void require_ranking_by_path(const StrictSection& root, const StudyFile& study) {
  const auto place = std::ranges::find_if(study.places, [](const StudyPlace& p) { return !p.datasets.empty(); });
  if (study.rank_by != "ate" && place != study.places.end())
    throw root.error("rank_by", "is " + study.rank_by + ", of maps; but the place '" + place->name +
                                    "' is of datasets, which have no surface to score a map by: use `rank_by: ate`");
}

}  // namespace

StudyFile read_study(const fs::path& file) {
  StrictSection root = StrictSection::load(file);
  StudyFile study;
  study.file = file;
  study.name = root.text("name").value_or(file.stem().string());
  study.seed = static_cast<std::uint64_t>(root.integer("seed", 1, 0, 1 << 30));
  study.repetitions = root.integer("repetitions", 1, 1, 1000);
  study.places = read_places(root.required_section("places"));
  study.cameras = read_cameras(root);
  study.systems = read_systems(root);
  study.exceptions = read_exceptions(root, study);
  study.rank_by = root.choice("rank_by", {"f_score", "ate"}).value_or(study.rank_by);
  require_ranking_by_path(root, study);
  study.threshold_m = root.positive_number("threshold").value_or(study.threshold_m);
  study.ate_limit_m = root.positive_number("ate_limit").value_or(study.ate_limit_m);
  if (auto alignment = root.section("alignment")) {
    const alignment::AlignMapOptions options = experiment::read_alignment_options(*alignment);
    if (options.start == alignment::AlignmentStart::kGiven)
      throw alignment->error("start", "names a transform: that of one map cannot serve the maps of all systems");
  }
  scoring::EvaluationSettings evaluation;
  if (auto section = root.section("evaluation")) evaluation = experiment::read_evaluation_settings(*section);
  if (!std::ranges::count(evaluation.thresholds_m, study.threshold_m))
    throw root.error("threshold", "is not one of the thresholds that are evaluated; add it to evaluation.thresholds");
  for (const char* section : {"alignment", "evaluation"})
    study.settings +=
        std::string(section) + ": " + (root.section(section) ? root.canonical_value(section) : "{}") + "\n";
  root.require_all_keys_used();
  return study;
}

}  // namespace tileflight::study
