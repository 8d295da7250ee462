#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/imaging/camera.h"

namespace tileflight::dataset {

struct FittedCalibration {
  imaging::Calibration calibration;
  std::string scaled_from;  ///< the size that the file is for, "1920x1080"; empty when it is that of the images
};

/// The file's camera for images of this size: as it is, or scaled (noted) where the shape is the same. `camera_id`: of
/// several in the file, else empty. Throws InputError: another shape, and what imaging::read_calibration says.
FittedCalibration calibration_for(const std::filesystem::path& file, const std::string& camera_id, int width,
                                  int height, std::vector<std::string>& notes);

}  // namespace tileflight::dataset
