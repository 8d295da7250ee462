#include "tileflight/data/dataset/scaled_calibration.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::dataset {

std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

ScaledCalibration read_scaled_calibration(const std::filesystem::path& file, const std::string& camera_id, int width,
                                          int height, std::vector<std::string>& notes) {
  return scaled_calibration(file.string(), imaging::read_calibration(file, camera_id), width, height, notes);
}

ScaledCalibration scaled_calibration(const std::string& name, imaging::Calibration calibration, int width, int height,
                                     std::vector<std::string>& notes) {
  const imaging::Camera camera = calibration.camera;
  if (camera.width() == width && camera.height() == height) return {calibration, {}};
  const std::string own_size = size_text(camera.width(), camera.height());
  const std::string sizes = "is for images of " + own_size + ", the frames have " + size_text(width, height);
  try {
    // The readout time of the whole image stays the same.
    calibration.line_delay_s *= static_cast<double>(camera.height()) / height;
    calibration.camera = camera.scaled_to(width, height);
  } catch (const InputError&) {
    throw InputError(name, sizes + ": the aspect ratio differs, so calibrate at the video's size");
  }
  notes.push_back(name + ": " + sizes + "; the calibration is scaled to them");
  return {calibration, own_size};
}

}  // namespace tileflight::dataset
