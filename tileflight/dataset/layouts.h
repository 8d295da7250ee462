#pragma once

#include "tileflight/dataset/dataset.h"

/// One reader for each layout of a folder that read_dataset knows. All throw InputError (file, line, cause).
namespace tileflight::dataset::layouts {

/// The camera that was chosen (there is one), for images of the size of the first frame's, which is known; what was put
/// up with goes to the dataset's warnings.
imaging::Calibration chosen_camera(const CameraChoice& camera, Dataset& dataset);

/// images/, the contract's layout and DSO's.
Dataset read_images_folder(const std::filesystem::path& folder, const CameraChoice& camera);

/// image_l/ or image_0/ (KITTI odometry).
bool is_kitti(const std::filesystem::path& folder);
Dataset read_kitti(const std::filesystem::path& folder, const CameraChoice& camera);

/// mav0/cam0/ or cam0/ (EuRoC, ASL layout).
bool is_euroc(const std::filesystem::path& folder);
Dataset read_euroc(const std::filesystem::path& folder, const CameraChoice& camera);

}  // namespace tileflight::dataset::layouts
