#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::dataset {

/// Names of the layouts that export_dataset writes: "tum-mono", "euroc", "kitti", "colmap".
const std::vector<std::string>& export_layouts();

struct ExportResult {
  std::size_t frames = 0;
  std::vector<std::string> notes;  ///< what the layout has no place for
};

/// Writes a dataset in another layout, whole or not at all:
///   tum-mono  images/, times.txt, camera.txt, pcalib.txt, vignette.png, groundtruthSync.txt; image files as they are
///   euroc     mav0/cam0 (PNG, named by nanoseconds), mav0/imu0 and mav0/state_groundtruth_estimate0 where known (poses
///             and velocities of the IMU, its biases where imu_bias.csv has them); lenses radial-tangential and
///             equidistant
///   kitti     image_0/ (PNG), times.txt, calib.txt, poses.txt (of the first frame's camera, as KITTI's are), velodyne/
///             where there are lidar scans (velodyne_export.h); pinholes
///   colmap    images/ as they are, sparse/0/ with COLMAP's text model of known poses and without points
/// Throws InputError: an unknown layout, a lens that the layout has no name for (the cure is said), a layout that needs
/// poses where there are none, an existing folder unless it may be replaced (geometry/output_folder.h). `inputs`: what
/// was read beside the dataset.
ExportResult export_dataset(const Dataset& dataset, const std::string& layout, const std::filesystem::path& folder,
                            bool replace, const Progress& progress = {},
                            std::vector<std::filesystem::path> inputs = {});

/// Throws InputError unless the trajectory has a pose at each frame's time (to a tenth of a millisecond); those poses.
std::vector<geometry::SE3> poses_of_frames(const Dataset& dataset);

}  // namespace tileflight::dataset
