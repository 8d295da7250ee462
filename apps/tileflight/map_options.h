#pragma once

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/evaluation/scoring/align_stage.h"
#include "tileflight/evaluation/scoring/evaluate.h"

namespace tileflight::app {

/// MAP of the contract and the known data of its flight.
struct MapOptions {
  std::string map;
  std::string dataset;
  std::string trajectory;
  std::string truth_trajectory;
};

void add_map_options(CLI::App& command, MapOptions& options);

/// The files and folders named by the options; none of them may be overwritten.
std::vector<std::filesystem::path> files_named(const MapOptions& options);

/// The contents of the dataset folder, overridden by files named explicitly.
scoring::MapInputs map_inputs(const MapOptions& options);

}  // namespace tileflight::app
