#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::dataset {

/// Result of export_mcap().
struct McapResult {
  std::size_t messages = 0;
  std::vector<std::string> topics;
};

/// Writes a dataset as one MCAP file of ROS 2 messages in time order: /camera/image/compressed, /camera/camera_info,
/// /tf (map to camera, IMU and lidar, if the true poses are known) and, if present, /imu, /gnss, /barometer,
/// /magnetometer, /range and /lidar. Throws InputError (file, cause), also for an existing file unless `replace`.
McapResult export_mcap(const Dataset& dataset, const std::filesystem::path& file, bool replace,
                       const Progress& progress = {});
/// The same of all cameras of a rig: topics and frames by their names (list_messages).
McapResult export_mcap(const Rig& rig, const std::filesystem::path& file, bool replace, const Progress& progress = {});

}  // namespace tileflight::dataset
