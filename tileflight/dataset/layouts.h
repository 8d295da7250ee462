#pragma once

#include "tileflight/dataset/dataset.h"

/// One reader for each layout of a folder that read_dataset knows. All throw InputError (file, line, cause).
namespace tileflight::dataset::layouts {

/// Reads the chosen camera (`camera.calibration` is not empty) for images of the size of the dataset's first frame.
/// Tolerated problems are added to the dataset's warnings.
imaging::Calibration read_chosen_camera(const CameraChoice& camera, Dataset& dataset);

/// images/, the contract's layout and DSO's.
Dataset read_images_folder(const std::filesystem::path& folder, const CameraChoice& camera);

/// image_l/ or image_0/ (KITTI odometry).
bool is_kitti(const std::filesystem::path& folder);
Dataset read_kitti(const std::filesystem::path& folder, const CameraChoice& camera);

/// mav0/cam0/ or cam0/ (EuRoC, ASL layout).
bool is_euroc(const std::filesystem::path& folder);
Dataset read_euroc(const std::filesystem::path& folder, const CameraChoice& camera);

}  // namespace tileflight::dataset::layouts
