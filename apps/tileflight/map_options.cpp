#include "map_options.h"

#include "tileflight/core/base/output_folder.h"

namespace tileflight::app {

void add_map_options(CLI::App& command, MapOptions& options) {
  command.add_option("MAP", options.map, "odometry folder (map.ply with trajectory.txt), or a PLY, PCD or XYZ cloud")
      ->required();
  command.add_option("--dataset", options.dataset, "dataset folder of the flight: camera, positions, true poses");
  command.add_option("--trajectory", options.trajectory,
                     "estimated poses in the map's frame (TUM); default: those of the odometry folder");
  command.add_option("--truth-trajectory", options.truth_trajectory,
                     "true poses in the local frame (TUM file, or dataset folder)");
}

std::vector<std::filesystem::path> files_named(const MapOptions& options) {
  namespace fs = std::filesystem;
  std::vector<fs::path> files{options.dataset, options.trajectory, options.truth_trajectory};
  const fs::path map = options.map;
  // A folder without a marker that holds another program's map may contain results of an earlier call.
  const bool is_other = fs::is_directory(map) && !base::read_folder_marker(map);
  for (const fs::path& file :
       is_other ? std::vector<fs::path>{map / "map.ply", map / "trajectory.txt"} : std::vector{map})
    files.push_back(file);
  return files;
}

scoring::MapInputs map_inputs(const MapOptions& options) {
  scoring::MapInputs inputs = scoring::find_map_inputs(options.map, options.dataset);
  if (!options.trajectory.empty()) inputs.trajectory = options.trajectory;
  if (!options.truth_trajectory.empty()) inputs.truth_trajectory = options.truth_trajectory;
  return inputs;
}

}  // namespace tileflight::app
