#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/slam/external_systems/adapter.h"

namespace tileflight::study {

/// An entry of `places:`. The value is an experiment file, whose place, truth and flights are used, or a map with the
/// keys experiment, flights, site, kind, or datasets: recordings from elsewhere, of which there is no surface.
struct StudyPlace {
  std::string name;
  std::string site;                  ///< the real place, which several entries may share; default: the name
  std::string kind;                  ///< of its flights, such as "orbit"; may be empty
  std::filesystem::path experiment;  ///< empty: the place is its datasets
  std::vector<std::string>
      flights;  ///< of "simulated" and "real", those that the experiment has; names of the datasets
  std::map<std::string, std::filesystem::path> datasets;  ///< by flight: folders that dataset::read_dataset() reads
};

/// An entry of `cameras:`, used for flights that are rendered.
struct StudyCamera {
  std::string name;  ///< empty: the flights' own cameras
  std::filesystem::path calibration;
};

/// An entry of `systems:`. Keys: adapter (a name, or a folder relative to the study; default: the entry's name),
/// time_limit (seconds), memory_limit (GB).
struct StudySystem {
  std::string name;
  external_systems::Adapter adapter;
  double time_limit_s = 0.0;     ///< 0: none
  double memory_limit_gb = 0.0;  ///< 0: none
};

/// An entry of `except:`: combinations that are not run. An empty member matches all.
struct StudyException {
  std::string place, camera, flight, system;
  std::string reason;
};

/// Contents of STUDY.yaml, with paths resolved.
struct StudyFile {
  std::filesystem::path file;
  std::string name;
  std::uint64_t seed = 1;  ///< of the first repetition; each further one has the next
  int repetitions = 1;
  std::vector<StudyPlace> places;
  std::vector<StudyCamera> cameras;  ///< at least one
  std::vector<StudySystem> systems;
  std::vector<StudyException> exceptions;
  std::string rank_by = "f_score";  ///< "f_score" or "ate"
  double threshold_m = 0.2;         ///< of accuracy, completeness and F-score
  double ate_limit_m = 1.0;         ///< path error that scores nothing, for rank_by: ate
  std::string settings;             ///< YAML text of `alignment:` and `evaluation:`
};

/// Reads a study file. `alignment:` and `evaluation:` are checked as an experiment's. Throws InputError (file, line,
/// key): unknown keys and names, missing files, an exception that excludes nothing, a threshold that is not evaluated,
/// a dataset without true poses, or in a study that ranks by maps.
StudyFile read_study(const std::filesystem::path& file);

}  // namespace tileflight::study
