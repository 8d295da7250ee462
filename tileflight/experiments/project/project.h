#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/core/geometry/geodesy.h"
#include "tileflight/experiments/project/choice.h"
#include "tileflight/experiments/project/lens_choice.h"
#include "tileflight/experiments/project/recording.h"
#include "tileflight/tiles/fetch/open_source.h"

namespace tileflight::project {

/// Holds the input of make_project().
struct ProjectOptions {
  RecordingFiles files;
  std::string place;                         ///< SOURCE of the contract; empty: the flight is tracked without a place
  std::optional<geometry::Geodetic> origin;  ///< of a tileset that is not georeferenced
  LensHints lens;
  /// Another SLAM system: a name of `tileflight systems` or the folder of an adapter; empty: the built-in odometry.
  std::string system;
  fetch::SourceOptions source_options;
};

/// Describes a project folder.
struct Project {
  std::filesystem::path experiment;   ///< experiment.yaml
  std::vector<Choice> choices;        ///< in the order of the file
  std::vector<std::string> warnings;  ///< what may make the choices wrong, a sentence each
};

/// Writes a project folder for a filmed flight, atomically: experiment.yaml, in which each choice has its reason and
/// how sure it is, camera.yaml, mask.png if something stands still in the image, and map.png, the flight over the
/// place. Throws InputError as examine_files, choose_lens, examine_images, choose_site and find_adapter do.
Project make_project(const ProjectOptions& options, const std::filesystem::path& folder, bool replace,
                     const Progress& progress = {});

/// Returns {experiment, choices: [{section, key, value, reason, certainty}], warnings}.
nlohmann::json to_json(const Project& project);

}  // namespace tileflight::project
