#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "input_options.h"
#include "tileflight/experiments/project/project.h"

namespace tileflight::app {

/// Command-line options of a project besides its recording, for `new` and for `run VIDEO`.
struct ProjectArguments {
  std::string place, camera, profiles, telemetry, imu, system;
  std::vector<double> origin;
  std::optional<double> fov_deg, from_s, to_s;
};

void add_project_options(CLI::App& command, ProjectArguments& arguments);

/// Returns the options of make_project().
project::ProjectOptions project_options(const ProjectArguments& arguments, std::vector<std::filesystem::path> videos,
                                        const SourceArguments& source);

/// Returns the choices and warnings of a project, a line or two each.
std::string project_text(const project::Project& made);

}  // namespace tileflight::app
