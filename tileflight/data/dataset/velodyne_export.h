#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/data/dataset/dataset.h"

namespace tileflight::dataset::exports {

/// Writes a lidar's scans in KITTI odometry's layout: folder/velodyne/000000.bin for each frame, with the points of the
/// scan whose middle is nearest in time, transformed to the lidar's pose at the frame's time (KITTI's scans are motion
/// compensated in the same way). A frame without a near scan has an empty file (with a note). Returns T_cam_velo, which
/// maps a scan's points into the frame's camera ("Tr" of calib.txt); nullopt, and no files, if the dataset has no scans
/// or no true poses (with a note). Throws InputError.
std::optional<geometry::SE3> write_velodyne(const Dataset& dataset, const std::filesystem::path& folder,
                                            std::vector<std::string>& notes);

}  // namespace tileflight::dataset::exports
