#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::exports {

/// Returns the names of the layouts that export_rig() writes: "tum-mono", "euroc", "kitti", "colmap", "vslamlab".
const std::vector<std::string>& export_layouts();

/// Result of export_rig().
struct ExportResult {
  std::size_t frames = 0;
  std::vector<std::string> notes;  ///< warnings of the dataset that was read, and data that the layout cannot store
};

/// Writes a dataset's cameras in another layout, atomically:
///   tum-mono  images/, times.txt, camera.txt, pcalib.txt, vignette.png, groundtruthSync.txt; image files are copied
///   euroc     mav0/cam0 (PNG, named by nanoseconds), mav0/imu0 and mav0/state_groundtruth_estimate0 if known (poses
///             and velocities of the IMU, its biases if imu_bias.csv has them); radial-tangential or equidistant lens
///   kitti     image_0/ (PNG), times.txt, calib.txt, poses.txt (relative to the first frame's camera, as in KITTI),
///             velodyne/ if there are lidar scans; pinholes only
///   colmap    images/ copied, sparse/0/ with COLMAP's text model of known poses, without points
///   vslamlab  a sequence of VSLAM-LAB, whose body is the first camera: rgb_0/ (copied), rgb.csv, calibration.yaml,
///             groundtruth.csv, imu_0.csv, depth_0/ (16-bit PNG); pinhole, radtan (4, 5, 8) or equidistant lens
/// For a rig, euroc writes each camera (cam0, cam1, …, with their T_BS), kitti a rectified pair as image_0 and image_1
/// (P0, P1), colmap each camera in a folder of its own with rigs.txt and frames.txt (COLMAP 3.12), vslamlab a pair as
/// rgb_0 and rgb_1, and tum-mono the first camera. Cameras that a layout has no place for are noted. `inputs`: files
/// that were read in addition to the dataset. Throws InputError: an unknown layout, a lens that the layout does not
/// support (with a remedy), a layout that needs poses for a dataset without, an existing folder unless it may be
/// replaced (core/base/output_folder.h).
ExportResult export_rig(const dataset::Rig& rig, const std::string& layout, const std::filesystem::path& folder,
                        bool replace, const Progress& progress = {}, std::vector<std::filesystem::path> inputs = {});
/// Exports a dataset with a single camera, as export_rig() does.
ExportResult export_dataset(const dataset::Dataset& dataset, const std::string& layout,
                            const std::filesystem::path& folder, bool replace, const Progress& progress = {},
                            std::vector<std::filesystem::path> inputs = {});

/// Returns the ground-truth pose of each frame. Throws InputError unless the trajectory has a pose at each frame's time
/// (within a tenth of a millisecond).
std::vector<geometry::SE3> find_frame_poses(const dataset::Dataset& dataset);

}  // namespace tileflight::exports
