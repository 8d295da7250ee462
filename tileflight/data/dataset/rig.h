#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset {

/// A camera of a rig, with its dataset.
struct RigCamera {
  std::string name;  ///< as in rig_camera_names; empty: the only camera of its dataset
  geometry::SE3
      T_body_camera;         ///< the body is the rig's own: the first camera's frame or, in EuRoC's layout, the IMU's
  double timeshift_s = 0.0;  ///< time on the body's clock = time of a frame + this (Kalibr's timeshift_cam_imu)
  Dataset dataset;           ///< its images, lens and poses, as those of a single camera
};

/// Cameras mounted on one body; at least one.
struct Rig {
  std::vector<RigCamera> cameras;
  /// Images of different cameras whose times differ by no more are of one instant. An ingested dataset states it in its
  /// dataset.yaml (`synchronisation.tolerance_s`).
  double sync_tolerance_s = 1e-4;
};

/// The frames that the cameras took at one instant.
struct RigInstant {
  double time_s = 0.0;                             ///< of the first of them, on the body's clock
  std::vector<std::optional<std::size_t>> frames;  ///< by camera: index into its frames; nullopt: it took none
};

/// Returns what is wrong with these names of cameras, which become names of folders, topics and frames; nullopt if
/// nothing is. A name has up to 64 letters, digits, '-' and '_', is not a frame of exports and viewers (map, odom,
/// base_link, imu, lidar, ...), and no two names are equal if case is ignored and '-' counts as '_'.
std::optional<std::string> fault_of_camera_names(const std::vector<std::string>& names);

/// Returns the names of the cameras of a dataset's folder: those in camchain.yaml of a rendered rig, cam0, cam1, … of
/// EuRoC's layout, image_0 and image_1 (or image_l and image_r) of KITTI's, rgb_0, rgb_1, … of VSLAM-LAB's. Empty if it
/// has a single camera. Throws InputError for a camchain.yaml that cannot be read, or whose names no camera can have.
std::vector<std::string> rig_camera_names(const std::filesystem::path& folder);

/// Reads all cameras of a dataset, also if it has only one. Throws InputError as read_dataset().
Rig read_rig(const std::filesystem::path& folder, const CameraChoice& camera = {});

/// Makes a rig of one camera.
Rig rig_of(Dataset dataset);

/// Groups the frames of all cameras by instants, in order of time. Frames of different cameras are of one instant if
/// their times differ by at most `tolerance_s` (nullopt: the rig's own).
std::vector<RigInstant> rig_instants(const Rig& rig, std::optional<double> tolerance_s = {});

}  // namespace tileflight::dataset
