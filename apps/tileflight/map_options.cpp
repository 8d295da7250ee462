#include "map_options.h"

namespace tileflight::app {

void add_map_options(CLI::App& command, MapOptions& options) {
  command.add_option("MAP", options.map, "odometry folder (map.ply with trajectory.txt), or a PLY, PCD or XYZ cloud")
      ->required();
  command.add_option("--dataset", options.dataset, "dataset folder of the flight: camera, positions, true poses");
  command.add_option("--trajectory", options.trajectory,
                     "estimated poses in the map's frame (TUM); default: those of the odometry folder");
  command.add_option("--truth-trajectory", options.truth_trajectory, "true poses in the local frame (TUM)");
}

experiment::MapInputs map_inputs(const MapOptions& options) {
  experiment::MapInputs inputs = experiment::map_inputs(options.map, options.dataset);
  if (!options.trajectory.empty()) inputs.trajectory = options.trajectory;
  if (!options.truth_trajectory.empty()) inputs.truth_trajectory = options.truth_trajectory;
  return inputs;
}

}  // namespace tileflight::app
