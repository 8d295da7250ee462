#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"

namespace tileflight::dataset::exports {

/// Writes a lidar's scans as KITTI odometry has them: folder/velodyne/000000.bin for each frame, with the points of the
/// scan whose middle is nearest in time, moved to where the lidar is at the frame's time (KITTI's are compensated so,
/// too). A frame that no scan is near has an empty file (noted). Returns T_cam_velo, which maps a scan's points into
/// the frame's camera ("Tr" of calib.txt); nullopt, without files: the dataset has no scans, or no true poses (noted).
/// Throws InputError.
std::optional<geometry::SE3> write_velodyne(const Dataset& dataset, const std::filesystem::path& folder,
                                            std::vector<std::string>& notes);

}  // namespace tileflight::dataset::exports
