#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tileflight/core/base/progress.h"
#include "tileflight/data/dataset/dataset.h"
#include "tileflight/slam/external_systems/adapter.h"

namespace tileflight::external_systems {

/// Returns why a system cannot run on a dataset at all: "needs an inertial unit, and the dataset has no imu.csv"; empty
/// if it can. An unknown lens is no obstacle, since images are rectified, except for systems with depth or several
/// cameras.
std::string why_not_applicable(const Adapter& adapter, const dataset::Dataset& dataset);

/// Dataset in the form that a system takes.
struct HandedDataset {
  std::filesystem::path folder;
  imaging::Calibration calibration;  ///< of the images as handed over
  bool rectified = false;
  double visible_share = 1.0;                ///< share of the native images' pixels that the rectified ones hold
  std::optional<geometry::SE3> T_cam_lidar;  ///< of the scans that were handed over, if there are any
  std::vector<std::string> notes;            ///< what was changed or left out, one line each
};

/// Prepares a dataset in `scratch`, an existing empty folder: rectifies images of a lens that the system does not know,
/// and writes the layout that it reads, with all cameras of a rig for a system that takes several. A dataset that needs
/// neither is used in place. Throws InputError as export_dataset().
HandedDataset hand_over(const Adapter& adapter, const dataset::Dataset& dataset, const std::filesystem::path& scratch,
                        const Progress& progress = {});

}  // namespace tileflight::external_systems
