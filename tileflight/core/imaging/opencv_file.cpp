// OpenCV's camera matrix and distortion coefficients: https://docs.opencv.org/4.x/d9/d0c/group__calib3d.html, the
// fisheye module's: https://docs.opencv.org/4.x/db/d58/group__calib3d__fisheye.html, and their names in ROS:
// https://wiki.ros.org/camera_calibration_parsers, sensor_msgs/CameraInfo.
#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/opencv_storage.h"

namespace tileflight::imaging {

namespace {

std::string quoted(const std::string& text) { return "\"" + text + "\""; }

std::vector<double> numbers_of(const StorageEntry& entry, const std::string& file) {
  std::vector<double> values;
  for (const std::string& word : entry.values) {
    const auto value = base::parse_number<double>(word);
    if (!value) throw InputError(file, quoted(entry.key) + ": " + quoted(word) + " is not a number");
    values.push_back(*value);
  }
  return values;
}

/// fx fy cx cy.
std::vector<double> read_matrix(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* entry = storage.find({"cameramatrix", "k", "intrinsicmatrix"});
  if (entry == nullptr)
    throw InputError(file,
                     "has no camera \"cam0\" (Kalibr's camchain) and no \"camera_matrix\" (OpenCV): give one of them");
  const std::vector<double> k = numbers_of(*entry, file);
  const bool square = (entry->rows.empty() || entry->rows == "3") && (entry->cols.empty() || entry->cols == "3");
  if (k.size() != 9 || !square) throw InputError(file, quoted(entry->key) + " must have 3 rows of 3 numbers");
  if (!(k[1] == 0.0 && k[3] == 0.0 && k[6] == 0.0 && k[7] == 0.0 && k[8] == 1.0))
    throw InputError(file, quoted(entry->key) +
                               " must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]: skew is not supported, calibrate without it");
  return {k[0], k[4], k[2], k[5]};
}

int opencv_side(const StorageEntry& entry, std::size_t place, const std::string& file) {
  const auto side = base::parse_number<int>(entry.values[place]);
  if (side && *side >= 1 && *side <= kMaxImageSide_px) return *side;
  throw InputError(file, quoted(entry.key) + " must be whole pixels from 1 to " + std::to_string(kMaxImageSide_px) +
                             ", not " + quoted(entry.values[place]));
}

struct ImageSize {
  int width = 0, height = 0;
};

ImageSize read_image_size(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* width = storage.find({"imagewidth", "width"});
  const StorageEntry* height = storage.find({"imageheight", "height"});
  if (width != nullptr && height != nullptr) {
    for (const StorageEntry* entry : {width, height})
      if (entry->values.size() != 1) throw InputError(file, quoted(entry->key) + " must be one number");
    return {opencv_side(*width, 0, file), opencv_side(*height, 0, file)};
  }
  const StorageEntry* size = storage.find({"imagesize"});
  if (size == nullptr)
    throw InputError(file, "has no image size: add the lines \"image_width\" and \"image_height\", pixels");
  if (size->values.size() != 2) throw InputError(file, quoted(size->key) + " must be width and height");
  return {opencv_side(*size, 0, file), opencv_side(*size, 1, file)};
}

enum class Family { kNotSaid, kPerspective, kFisheye };

Family read_family(const OpenCvStorage& storage, const std::string& file) {
  if (const StorageEntry* model = storage.find({"distortionmodel"}); model != nullptr && !model->values.empty()) {
    const std::string& name = model->values.front();
    if (name == "plumb_bob" || name == "rational_polynomial") return Family::kPerspective;
    if (name == "equidistant" || name == "fisheye") return Family::kFisheye;
    if (!name.empty())
      throw InputError(file, "distortion model " + quoted(name) +
                                 " is unknown: use plumb_bob, rational_polynomial, equidistant or fisheye");
  }
  const StorageEntry* flag = storage.find({"fisheyemodel", "fisheye"});
  if (flag == nullptr || flag->values.empty()) return Family::kNotSaid;
  const std::string& value = flag->values.front();
  if (value == "1" || value == "true") return Family::kFisheye;
  if (value == "0" || value == "false") return Family::kPerspective;
  throw InputError(file, quoted(flag->key) + " must be 0 or 1, not " + quoted(value));
}

NamedDistortion read_distortion(const OpenCvStorage& storage, const std::string& file) {
  const StorageEntry* entry =
      storage.find({"distortioncoefficients", "distcoeffs", "distortioncoeffs", "distcoef", "d"});
  if (entry == nullptr)
    throw InputError(file, "has no \"distortion_coefficients\": add them, five zeros for a lens without distortion");
  const std::vector<double> d = numbers_of(*entry, file);
  const Family family = read_family(storage, file);
  if (family == Family::kFisheye) return {"equidistant", d};
  if (family == Family::kNotSaid && d.size() == 4)
    throw InputError(file, quoted(entry->key) +
                               " has 4 numbers, either k1 k2 p1 p2 or the fisheye module's k1 k2 k3 k4: specify which "
                               "with the line \"distortion_model: plumb_bob\" or \"distortion_model: equidistant\"");
  return parse_opencv_distortion(file + ": " + quoted(entry->key), d);
}

}  // namespace

Calibration read_opencv(const std::filesystem::path& file) {
  const std::string name = file.string();
  const OpenCvStorage storage(base::read_text(file, kMaxCalibrationBytes), name);
  const std::vector<double> focal = read_matrix(storage, name);
  const ImageSize size = read_image_size(storage, name);
  const NamedDistortion distortion = read_distortion(storage, name);
  Calibration calibration;
  calibration.camera = make_camera(name, {distortion.name, focal, distortion.coefficients, size.width, size.height});
  return calibration;
}

}  // namespace tileflight::imaging
