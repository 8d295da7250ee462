#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/dataset/dataset.h"
#include "tileflight/geometry/progress.h"

namespace tileflight::dataset {

struct McapResult {
  std::size_t messages = 0;
  std::vector<std::string> topics;
};

/// A dataset as one MCAP file of ROS 2 messages in the order of their times: /camera/image/compressed,
/// /camera/camera_info, /tf (map to camera, imu and lidar, where the truth is known) and what there is of /imu, /gnss,
/// /barometer, /magnetometer, /range and /lidar. Throws InputError (file, cause), also for an existing file unless
/// `replace`.
McapResult export_mcap(const Dataset& dataset, const std::filesystem::path& file, bool replace,
                       const Progress& progress = {});

}  // namespace tileflight::dataset
