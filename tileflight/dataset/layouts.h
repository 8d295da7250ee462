#pragma once

#include "tileflight/dataset/dataset.h"

/// One reader for each layout of a folder that read_dataset knows. All throw InputError (file, line, cause).
namespace tileflight::dataset::layouts {

/// images/, the contract's layout and DSO's.
Dataset read_images_folder(const std::filesystem::path& folder);

/// image_l/ or image_0/ (KITTI odometry).
bool is_kitti(const std::filesystem::path& folder);
Dataset read_kitti(const std::filesystem::path& folder);

/// mav0/cam0/ or cam0/ (EuRoC, ASL layout).
bool is_euroc(const std::filesystem::path& folder);
Dataset read_euroc(const std::filesystem::path& folder);

}  // namespace tileflight::dataset::layouts
