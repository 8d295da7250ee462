// VSLAM-LAB's calibration.yaml, as its own datasets have it: https://github.com/VSLAM-LAB/VSLAM-LAB, folder Datasets.
// Present form (since 2025-12-30): lists `cameras` and `imus`, T_BS maps sensor to body, row by row. Earlier forms:
// keys of ORB-SLAM2's settings, "Camera.fx" (2024) or "Camera0.fx" (2025), with IMU.T_b_c1 from camera to IMU.
#include <algorithm>
#include <array>
#include <cmath>
#include <variant>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

/// A sensor's pose in the body, T_BS (OKVIS2's own files: T_SC, the IMU being the body); identity if there is none.
geometry::SE3 pose_in_body(const YAML::Node& sensor, const std::string& file) {
  for (const char* key : {"T_BS", "T_SC"})
    if (const YAML::Node node = sensor[key]) return yaml_rigid_motion(node, key, file);
  return {};
}

double positive_or_zero(const YAML::Node& node, const std::string& key, const std::string& file) {
  if (!node) return 0.0;
  const double value = yaml_scalar<double>(node, key, file);
  if (!std::isfinite(value) || value <= 0.0) throw InputError(file, "\"" + key + "\" must be above 0");
  return value;
}

InputError unknown_lens(const std::string& file) {
  return {file, "the camera's model is \"unknown\": give a calibration (--camera)"};
}

/// Name and coefficients of make_camera for VSLAM-LAB's or OKVIS2's distortion.
NamedDistortion named_distortion(const std::string& type, const std::vector<double>& coefficients,
                                 const std::string& file) {
  struct Known {
    const char* type;
    std::size_t count;
  };
  constexpr std::array<Known, 7> kBrownConrady{{{"radtan4", 4},
                                                {"radtan5", 5},
                                                {"radtan8", 8},
                                                {"radialtangential", 4},
                                                {"plumb_bob", 4},
                                                {"radialtangential8", 8},
                                                {"plumb_bob8", 8}}};
  if (type == "pinhole" || type == "none") return {"none", {}};
  if (type == "unknown") throw unknown_lens(file);
  if (type == "equid4" || type == "equidistant") return {"equidistant", coefficients};
  const auto found =
      std::find_if(kBrownConrady.begin(), kBrownConrady.end(), [&](const Known& known) { return known.type == type; });
  if (found == kBrownConrady.end())
    throw InputError(file, "distortion_type \"" + type + "\" is unknown: use radtan4, radtan5, radtan8 or equid4");
  if (coefficients.size() != found->count)
    throw InputError(file, "\"distortion_coefficients\" of " + type + " must have " + std::to_string(found->count) +
                               " numbers, not " + std::to_string(coefficients.size()));
  return parse_opencv_distortion(file + ": \"distortion_coefficients\"", coefficients);
}

NamedDistortion listed_distortion(const YAML::Node& camera, const std::string& file) {
  std::string type = "pinhole";
  for (const char* key : {"cam_model", "distortion_type"})
    if (const YAML::Node node = camera[key]) {
      type = yaml_scalar<std::string>(node, key, file);
      if (type == "unknown") throw unknown_lens(file);
    }
  const YAML::Node node = camera["distortion_coefficients"];
  return named_distortion(type, node ? yaml_numbers(node, "distortion_coefficients", file) : std::vector<double>{},
                          file);
}

std::array<double, 2> listed_pair(const YAML::Node& camera, const std::string& key, const std::string& file) {
  const std::vector<double> values = yaml_numbers(required_value(camera, key, file), key, file);
  if (values.size() != 2) throw InputError(file, "\"" + key + "\" must have 2 numbers");
  return {values[0], values[1]};
}

VslamLabCamera listed_camera(const YAML::Node& root, const YAML::Node& camera, const std::string& file) {
  const std::array<double, 2> focal = listed_pair(camera, "focal_length", file);
  const std::array<double, 2> center = listed_pair(camera, "principal_point", file);
  const NamedDistortion distortion = listed_distortion(camera, file);
  const auto [width, height] = checked_image_size(
      yaml_numbers(required_value(camera, "image_dimension", file), "image_dimension", file), "image_dimension", file);
  const std::array<double, 4> intrinsics{focal[0], focal[1], center[0], center[1]};
  VslamLabCamera result;
  result.calibration.camera = make_camera(file, {distortion.name, intrinsics, distortion.coefficients, width, height});
  result.T_body_cam = pose_in_body(camera, file);
  if (const YAML::Node imus = root["imus"]; imus && imus.IsSequence() && imus.size() > 0 && imus[0].IsMap())
    result.calibration.T_cam_imu = result.T_body_cam.inverse() * pose_in_body(imus[0], file + ": imus");
  else
    result.calibration.assumes_T_cam_imu = true;
  result.depth_units_per_m = positive_or_zero(camera["depth_factor"], "depth_factor", file);
  return result;
}

/// The name of entry `index` of `cameras`; OKVIS2's have none.
std::string listed_name(const YAML::Node& camera, std::size_t index) {
  const YAML::Node name = camera.IsMap() ? camera["cam_name"] : YAML::Node();
  return name && name.IsScalar() ? name.as<std::string>() : "rgb_" + std::to_string(index);
}

/// A camera of the earlier forms, whose keys begin with `prefix`.
struct PrefixedCamera {
  std::string prefix;
  std::string name;
};

/// ORB-SLAM3 counts from Camera1, VSLAM-LAB of 2025 from Camera0.
std::vector<PrefixedCamera> prefixed_cameras(const YAML::Node& root) {
  const bool from_zero = static_cast<bool>(root["Camera0.fx"]);
  std::vector<PrefixedCamera> cameras;
  if (root["Camera.fx"] && !from_zero) cameras.push_back({"Camera.", "rgb_0"});
  for (const char* number : {"0", "1", "2"}) {
    const std::string prefix = "Camera" + std::string(number) + ".";
    if (root[prefix + "fx"]) cameras.push_back({prefix, "rgb_" + std::to_string(cameras.size())});
  }
  return cameras;
}

/// The value of the first of these keys that is there.
YAML::Node first_value(const YAML::Node& root, std::initializer_list<std::string> keys) {
  for (const std::string& key : keys)
    if (const YAML::Node node = root[key]) return node;
  return YAML::Node(YAML::NodeType::Undefined);
}

NamedDistortion prefixed_distortion(const YAML::Node& root, const std::string& prefix, const std::string& file) {
  // ORB-SLAM3 states the model of all cameras once, as Camera.type.
  const YAML::Node model_node = first_value(root, {prefix + "model", prefix + "type", "Camera.model", "Camera.type"});
  const std::string model =
      model_node ? base::to_lower(yaml_scalar<std::string>(model_node, "Camera.type", file)) : "opencv";
  if (model == "unknown") throw unknown_lens(file);
  const bool is_fisheye = model.find("fisheye") != std::string::npos || model.starts_with("kannalabrandt");
  using Keys = std::vector<std::string>;
  const Keys keys = is_fisheye ? Keys{"k1", "k2", "k3", "k4"} : Keys{"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
  std::vector<double> coefficients;
  for (const std::string& key : keys) {  // those after a missing one have no meaning
    const YAML::Node node = root[prefix + key];
    if (!node) break;
    coefficients.push_back(yaml_scalar<double>(node, prefix + key, file));
  }
  if (is_fisheye) return {"equidistant", coefficients};
  return parse_opencv_distortion(file + ": " + prefix + "k1 to k6", coefficients);
}

/// ORB-SLAM3 resizes images of Camera.width x Camera.height to another size, and scales fx to cy with them
/// (its Settings::readImageInfo). So what the file states is for images before that.
void note_resizing(const YAML::Node& root, const std::string& prefix, const std::array<int, 2>& size,
                   const std::string& file, std::vector<std::string>& notes) {
  const auto side = [&](const char* key, int unchanged) {
    const YAML::Node node = root[key];
    return node ? yaml_scalar<double>(node, key, file) : unchanged;
  };
  const double width = side("Camera.newWidth", size[0]), height = side("Camera.newHeight", size[1]);
  if (width == size[0] && height == size[1]) return;
  notes.push_back(file + ": Camera.newWidth and Camera.newHeight (" + base::trimmed_text(width, 3) + "x" +
                  base::trimmed_text(height, 3) + ") are not used: " + prefix +
                  "fx to cy are of images as recorded, Camera.width x Camera.height (" + std::to_string(size[0]) + "x" +
                  std::to_string(size[1]) + "), which ORB-SLAM3 itself resizes");
}

VslamLabCamera prefixed_camera(const YAML::Node& root, const std::string& prefix, const std::string& file) {
  const auto number = [&](const std::string& key) {
    return yaml_scalar<double>(required_value(root, prefix + key, file), prefix + key, file);
  };
  const std::array<double, 4> intrinsics{number("fx"), number("fy"), number("cx"), number("cy")};
  const NamedDistortion distortion = prefixed_distortion(root, prefix, file);
  const YAML::Node width_node = first_value(root, {prefix + "w", prefix + "width", "Camera.width"});
  const YAML::Node height_node = first_value(root, {prefix + "h", prefix + "height", "Camera.height"});
  if (!width_node || !height_node)
    throw InputError(file, "has no image size: add the lines \"Camera.width\" and \"Camera.height\", pixels");
  const std::array<double, 2> sides{yaml_scalar<double>(width_node, "Camera.width", file),
                                    yaml_scalar<double>(height_node, "Camera.height", file)};
  const auto [width, height] = checked_image_size(sides, "Camera.width, Camera.height", file);
  VslamLabCamera result;
  result.calibration.camera = make_camera(file, {distortion.name, intrinsics, distortion.coefficients, width, height});
  read_extrinsics(root, file, result.calibration);
  note_resizing(root, prefix, {width, height}, file, result.calibration.notes);
  if (root["LEFT.K"])  // ORB-SLAM2's and ORB-SLAM3's older settings of a stereo camera
    result.calibration.notes.push_back(
        file + ": " + prefix +
        "fx to cy are those of images rectified by LEFT.R; for images as recorded, give a file with LEFT.K as "
        "camera_matrix and LEFT.D as distortion_coefficients");
  result.depth_units_per_m =
      positive_or_zero(first_value(root, {"Depth0.factor", "Depth.factor", "depth_factor"}), "depth factor", file);
  return result;
}

VslamLabCamera find_camera(const YAML::Node& root, const std::string& camera_id, const std::string& file) {
  if (root.IsMap()) {
    const YAML::Node cameras = root["cameras"];
    for (std::size_t i = 0; cameras && cameras.IsSequence() && i < cameras.size(); ++i)
      if (cameras[i].IsMap() && listed_name(cameras[i], i) == camera_id)
        return listed_camera(root, cameras[i], file + ": " + camera_id);
    for (const PrefixedCamera& camera : prefixed_cameras(root))
      if (camera.name == camera_id) return prefixed_camera(root, camera.prefix, file);
  }
  throw InputError(file, "has no camera \"" + camera_id + "\" in VSLAM-LAB's form (`cameras`, or Camera.fx)");
}

/// focal_length, principal_point and distortion of a pinhole.
template <class Model>
std::string lens_entries(const Model& m, const std::string& type, const std::string& coefficients) {
  return "cam_model: pinhole,\n     " +
         (type.empty() ? std::string()
                       : "distortion_type: " + type + ",\n     distortion_coefficients: " + coefficients + ",\n     ") +
         "focal_length: " + number_list({m.fx, m.fy}) + ",\n     principal_point: " + number_list({m.cx, m.cy});
}

std::optional<std::string> lens_entries_of(const CameraModel& model) {
  if (const auto* m = std::get_if<PinholeRadtan>(&model)) {
    const auto& d = m->d;
    if (d == std::array<double, 4>{}) return lens_entries(*m, "", "");
    return lens_entries(*m, "radtan4", number_list({d[0], d[1], d[2], d[3]}));
  }
  if (const auto* m = std::get_if<KannalaBrandt>(&model))
    return lens_entries(*m, "equid4", number_list({m->k[0], m->k[1], m->k[2], m->k[3]}));
  const auto* m = std::get_if<PinholeRational>(&model);
  if (m == nullptr || std::any_of(m->d.begin() + 8, m->d.end(), [](double s) { return s != 0.0; })) return {};
  const auto& d = m->d;
  if (d[5] == 0.0 && d[6] == 0.0 && d[7] == 0.0)
    return lens_entries(*m, "radtan5", number_list({d[0], d[1], d[2], d[3], d[4]}));
  return lens_entries(*m, "radtan8", number_list({d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]}));
}

}  // namespace

VslamLabCamera read_vslam_lab_camera(const std::filesystem::path& file, const std::string& camera_id) {
  const YAML::Node root = load_calibration_yaml(file);
  try {
    return find_camera(root, camera_id, file.string());
  } catch (const YAML::Exception& error) {
    throw InputError(file.string(), "is not VSLAM-LAB's calibration.yaml: " + error.msg);
  }
}

std::vector<std::string> vslam_lab_camera_ids(const std::filesystem::path& file) {
  const YAML::Node root = load_calibration_yaml(file);
  std::vector<std::string> ids;
  if (!root.IsMap()) return ids;
  const YAML::Node cameras = root["cameras"];
  for (std::size_t i = 0; cameras && cameras.IsSequence() && i < cameras.size(); ++i)
    ids.push_back(listed_name(cameras[i], i));
  for (const PrefixedCamera& camera : prefixed_cameras(root)) base::add_distinct({camera.name}, ids);
  return ids;
}

std::optional<std::string> vslam_lab_lens_text(const Camera& camera) {
  const std::optional<std::string> lens = lens_entries_of(camera.model());
  if (!lens) return std::nullopt;
  return *lens + ",\n     image_dimension: [" + std::to_string(camera.width()) + ", " +
         std::to_string(camera.height()) + "]";
}

}  // namespace tileflight::imaging
