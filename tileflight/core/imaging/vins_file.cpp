// Calibrations of VINS-Mono and VINS-Fusion, which are those of camodocal: https://github.com/hengli/camodocal
#include <array>
#include <filesystem>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

std::vector<double> section_numbers(const YAML::Node& root, const std::string& section,
                                    std::initializer_list<const char*> keys, const std::string& file) {
  const YAML::Node node = required_value(root, section, file);
  if (!node.IsMap()) throw InputError(file, "\"" + section + "\" must hold the camera's numbers");
  std::vector<double> values;
  for (const char* key : keys)
    values.push_back(yaml_scalar<double>(required_value(node, key, file + ": " + section), key, file));
  return values;
}

Camera read_vins_lens(const YAML::Node& root, const std::string& file) {
  const auto model = yaml_scalar<std::string>(required_value(root, "model_type", file), "model_type", file);
  const auto side = [&](const char* key) { return yaml_scalar<double>(required_value(root, key, file), key, file); };
  const auto [width, height] =
      checked_image_size(std::array{side("image_width"), side("image_height")}, "image_width, image_height", file);
  const std::string projection = "projection_parameters", distortion = "distortion_parameters";
  if (model == "PINHOLE") {
    const auto f = section_numbers(root, projection, {"fx", "fy", "cx", "cy"}, file);
    const auto k = section_numbers(root, distortion, {"k1", "k2", "p1", "p2"}, file);
    return make_camera(file, {"radtan", f, k, width, height});
  }
  if (model == "PINHOLE_FULL") {  // of VINS-Fusion: OpenCV's rational model
    const auto f = section_numbers(root, projection, {"fx", "fy", "cx", "cy"}, file);
    const auto k = section_numbers(root, distortion, {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}, file);
    const NamedDistortion lens = parse_opencv_distortion(file + ": " + distortion, k);
    return make_camera(file, {lens.name, f, lens.coefficients, width, height});
  }
  if (model == "MEI") {
    const auto f = section_numbers(root, projection, {"gamma1", "gamma2", "u0", "v0"}, file);
    const auto k = section_numbers(root, distortion, {"k1", "k2", "p1", "p2"}, file);
    const auto xi = section_numbers(root, "mirror_parameters", {"xi"}, file);
    return make_camera(file, {"radtan", f, k, width, height, "omni", xi});
  }
  if (model == "KANNALA_BRANDT") {  // k2 is the coefficient of theta^3: k1 here
    const auto f = section_numbers(root, projection, {"mu", "mv", "u0", "v0"}, file);
    const auto k = section_numbers(root, projection, {"k2", "k3", "k4", "k5"}, file);
    return make_camera(file, {"equidistant", f, k, width, height});
  }
  throw InputError(file,
                   "model_type \"" + model + "\" is not supported: use PINHOLE, PINHOLE_FULL, MEI or KANNALA_BRANDT");
}

}  // namespace

Calibration read_vins(const std::filesystem::path& file) {
  const YAML::Node root = load_calibration_yaml(file);
  const std::string name = file.string();
  if (!root.IsMap()) throw InputError(name, "is not VINS's calibration: it has no \"model_type\"");
  Calibration calibration;
  if (const YAML::Node lens = root["cam0_calib"]) {  // VINS-Fusion keeps the lens in a file beside this one
    const auto lens_name = std::filesystem::path(yaml_scalar<std::string>(lens, "cam0_calib", name)).filename();
    calibration.camera = read_vins_lens(load_calibration_yaml(file.parent_path() / lens_name),
                                        (file.parent_path() / lens_name).string());
    calibration.notes.push_back(name + ": the camera of cam0_calib and body_T_cam0 is read");
  } else {
    calibration.camera = read_vins_lens(root, name);
  }
  read_extrinsics(root, name, calibration);
  const YAML::Node estimated = root["estimate_extrinsic"];
  if (!calibration.assumes_T_cam_imu && estimated &&
      yaml_scalar<std::string>(estimated, "estimate_extrinsic", name) == "1")
    calibration.notes.push_back(name + ": estimate_extrinsic is 1, so its T_cam_imu is only a first guess");
  return calibration;
}

}  // namespace tileflight::imaging
