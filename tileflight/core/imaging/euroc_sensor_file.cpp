#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {
namespace {

/// Converts EuRoC's name of a lens model to Kalibr's.
std::string kalibr_distortion_name(const std::string& name) {
  if (name == "radial-tangential" || name == "radtan") return "radtan";
  if (name == "equidistant") return "equidistant";
  return name;  // rejected by name when the calibration is checked
}

}  // namespace

Calibration read_euroc_sensor(const std::filesystem::path& file) {
  const YAML::Node node = load_calibration_yaml(file);
  try {
    const auto intrinsics = node["intrinsics"].as<std::vector<double>>();
    const auto coefficients = node["distortion_coefficients"].as<std::vector<double>>();
    const auto resolution = node["resolution"].as<std::vector<int>>();
    if (resolution.size() != 2) throw InputError(file.string(), "resolution must be width and height");
    Calibration calibration;
    calibration.camera = make_camera(file.string(), {kalibr_distortion_name(node["distortion_model"].as<std::string>()),
                                                     intrinsics, coefficients, resolution[0], resolution[1]});
    read_extrinsics(node, file.string(), calibration);
    return calibration;
  } catch (const YAML::Exception& error) {
    throw InputError(file.string(),
                     "is not EuRoC's sensor.yaml with intrinsics, distortion_model, "
                     "distortion_coefficients and resolution: " +
                         error.msg);
  }
}

}  // namespace tileflight::imaging
