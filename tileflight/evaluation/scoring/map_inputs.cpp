#include "tileflight/evaluation/scoring/map_inputs.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/geometry/cloud_files.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/evaluation/scoring/map_points.h"

namespace tileflight::scoring {
namespace fs = std::filesystem;

MapInputs find_map_inputs(const fs::path& map, const fs::path& dataset_folder) {
  const auto if_there = [](const fs::path& file) { return fs::exists(file) ? file : fs::path(); };
  MapInputs inputs{.map = map};
  if (fs::is_directory(map)) inputs.trajectory = if_there(map / "trajectory.txt");
  if (dataset_folder.empty()) return inputs;
  if (!fs::is_directory(dataset_folder)) throw InputError(dataset_folder.string(), "no such dataset folder");
  inputs.truth_trajectory = if_there(dataset_folder / "groundtruth.txt");
  inputs.gps = if_there(dataset_folder / "gps.csv");
  inputs.attitude = if_there(dataset_folder / "attitude.csv");
  inputs.camera = if_there(dataset_folder / "camera.yaml");
  inputs.dataset = dataset_folder;
  if (dataset::has_foreign_layout(dataset_folder)) {  // the reader of datasets knows where lens and poses are
    inputs.camera = dataset_folder;
    inputs.truth_trajectory = dataset::read_dataset(dataset_folder).groundtruth ? dataset_folder : fs::path();
  }
  return inputs;
}

geometry::Trajectory read_true_poses(const fs::path& file_or_dataset) {
  if (!fs::is_directory(file_or_dataset)) return geometry::read_tum(file_or_dataset);
  const dataset::Dataset dataset = dataset::read_dataset(file_or_dataset);
  if (!dataset.groundtruth) throw InputError(file_or_dataset.string(), "the dataset has no true poses");
  return *dataset.groundtruth;
}

imaging::Camera read_flight_camera(const fs::path& file_or_dataset) {
  if (fs::is_directory(file_or_dataset)) return dataset::read_dataset(file_or_dataset).calibration.camera;
  return imaging::read_calibration(file_or_dataset).camera;
}

geometry::PointCloud read_map(const fs::path& map) {
  const fs::path file = map_file(map);
  geometry::PointCloud cloud = geometry::read_cloud(file);
  if (cloud.empty()) throw InputError(file.string(), "the map has no points; there is nothing to score");
  return cloud;
}

}  // namespace tileflight::scoring
