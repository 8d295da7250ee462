#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tileflight/core/imaging/camera.h"

namespace tileflight::dataset {

/// A calibration for images of a given size.
struct ScaledCalibration {
  imaging::Calibration calibration;
  std::string scaled_from;  ///< the image size of the file, "1920x1080"; empty if it equals that of the images
};

/// "1920x1080", for messages.
std::string size_text(int width, int height);

/// Reads the file's camera for images of this size, scaled (with a note) if only the aspect ratio is the same.
/// `camera_id`: which of several cameras in the file, else empty. Throws InputError: another aspect ratio, and errors
/// of imaging::read_calibration.
ScaledCalibration read_scaled_calibration(const std::filesystem::path& file, const std::string& camera_id, int width,
                                          int height, std::vector<std::string>& notes);

/// The same of a calibration that has been read. `name`: for messages.
ScaledCalibration scaled_calibration(const std::string& name, imaging::Calibration calibration, int width, int height,
                                     std::vector<std::string>& notes);

}  // namespace tileflight::dataset
