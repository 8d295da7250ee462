#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/experiment/evaluate.h"
#include "tileflight/experiment/score.h"

namespace tileflight::app {

/// MAP of the contract and what is known about its flight.
struct MapOptions {
  std::string map;
  std::string dataset;
  std::string trajectory;
  std::string truth_trajectory;
};

void add_map_options(CLI::App& command, MapOptions& options);

/// The files and folders that the options name: a file that is written takes the place of none of them.
std::vector<std::filesystem::path> files_named(const MapOptions& options);

/// What the dataset folder holds, with what was named by itself on top.
experiment::MapInputs map_inputs(const MapOptions& options);

}  // namespace tileflight::app
