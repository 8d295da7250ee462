#pragma once

#include <CLI/CLI.hpp>
#include <string>

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

/// What the dataset folder holds, with what was named by itself on top.
experiment::MapInputs map_inputs(const MapOptions& options);

}  // namespace tileflight::app
