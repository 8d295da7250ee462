// Calibrations that other programs keep as JSON:
//   OpenSfM and OpenDroneMap, camera_models.json and cameras.json: https://opensfm.org/docs/cam_coord_system.html;
//     numbers are shares of the larger side of the image, and the principal point is relative to the image's centre;
//   basalt, calibration.json: https://gitlab.com/VladyslavUsenko/basalt/-/blob/master/doc/Calibration.md;
//   nerfstudio and instant-ngp, transforms.json: https://docs.nerf.studio/quickstart/data_conventions.html; pixel
//     centres are at halves.
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

using Json = nlohmann::json;

/// An object of a calibration, with messages that name file and key.
class JsonCamera {
 public:
  JsonCamera(const Json& object, std::string where) : object_(object), where_(std::move(where)) {
    if (!object.is_object()) throw InputError(where_, "must be an object with the camera's numbers");
  }

  const std::string& where() const { return where_; }
  bool has(const char* key) const { return object_.contains(key); }

  double number(const char* key) const {
    if (!has(key)) throw InputError(where_, "the camera has no key \"" + std::string(key) + "\"");
    const Json& value = object_.at(key);
    if (!value.is_number() || !std::isfinite(value.get<double>()))
      throw InputError(where_, "\"" + std::string(key) + "\" must be a number");
    return value.get<double>();
  }
  double number_or(const char* key, double other) const { return has(key) ? number(key) : other; }

  std::string word(const char* key) const {
    if (!has(key) || !object_.at(key).is_string())
      throw InputError(where_, "the camera has no word \"" + std::string(key) + "\"");
    return object_.at(key).get<std::string>();
  }

  std::vector<double> numbers_or_zero(std::initializer_list<const char*> keys) const {
    std::vector<double> values;
    for (const char* key : keys) values.push_back(number_or(key, 0.0));
    return values;
  }

  std::array<int, 2> size(const char* width, const char* height) const {
    return checked_image_size(std::array{number(width), number(height)}, std::string(width) + ", " + height, where_);
  }

  /// Throws InputError if one of these coefficients is not 0.
  void require_zero(std::initializer_list<const char*> keys, const std::string& model) const {
    for (const char* key : keys)
      if (number_or(key, 0.0) != 0.0)
        throw InputError(where_, "\"" + std::string(key) + "\" of the model \"" + model +
                                     "\" is not 0, which no lens model here has: undistort the images, or calibrate "
                                     "without it");
  }

 private:
  const Json& object_;
  std::string where_;
};

NamedDistortion brown(const JsonCamera& camera) {
  return parse_opencv_distortion(camera.where() + ": k1 to k6",
                                 camera.numbers_or_zero({"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"}));
}

NamedDistortion fisheye(const JsonCamera& camera) {
  return {"equidistant", camera.numbers_or_zero({"k1", "k2", "k3", "k4"})};
}

// ---- OpenSfM ----

Calibration read_opensfm_camera(const JsonCamera& camera) {
  const std::string type = camera.word("projection_type");
  const auto [width, height] = camera.size("width", "height");
  const double larger = std::max(width, height);
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  if (type == "spherical" || type == "equirectangular") {
    calibration.camera = make_panorama(width, height);
    return calibration;
  }
  const double focal_x = camera.has("focal_x") ? camera.number("focal_x") : camera.number("focal");
  const double focal_y = camera.has("focal_y") ? camera.number("focal_y") : focal_x;
  const std::array<double, 4> intrinsics{focal_x * larger, focal_y * larger,
                                         0.5 * (width - 1) + camera.number_or("c_x", 0.0) * larger,
                                         0.5 * (height - 1) + camera.number_or("c_y", 0.0) * larger};
  NamedDistortion distortion;
  if (type == "perspective" || type == "brown" || type == "radial" || type == "simple_radial") {
    camera.require_zero({"k4", "k5", "k6"}, type);
    distortion = brown(camera);
  } else if (type == "fisheye" || type == "fisheye_opencv") {
    distortion = fisheye(camera);
  } else if (type == "fisheye62" || type == "fisheye624") {
    camera.require_zero({"k5", "k6", "p1", "p2", "s0", "s1", "s2", "s3"}, type);
    distortion = fisheye(camera);
  } else {
    throw InputError(camera.where(),
                     "projection_type \"" + type +
                         "\" is not supported: use perspective, brown, simple_radial, radial, fisheye, fisheye_opencv "
                         "or spherical");
  }
  calibration.camera =
      make_camera(camera.where(), {distortion.name, intrinsics, distortion.coefficients, width, height});
  return calibration;
}

std::vector<NamedCalibration> read_opensfm(const Json& root, const std::string& file) {
  std::vector<NamedCalibration> cameras;
  for (const auto& [name, object] : root.items())
    cameras.push_back(
        {name, read_opensfm_camera(JsonCamera(object, file + ": camera \"" + name.substr(0, 80) + "\""))});
  return cameras;
}

// ---- basalt ----

geometry::SE3 read_basalt_pose(const JsonCamera& pose) {
  const Eigen::Quaterniond q(pose.number("qw"), pose.number("qx"), pose.number("qy"), pose.number("qz"));
  constexpr double kUnit = 0.01;
  if (!(std::abs(q.norm() - 1.0) < kUnit)) throw InputError(pose.where(), "the quaternion does not have length 1");
  return {q.normalized().toRotationMatrix(), geometry::Vec3(pose.number("px"), pose.number("py"), pose.number("pz"))};
}

Camera read_basalt_lens(const JsonCamera& camera, const JsonCamera& k, int width, int height) {
  const std::string type = camera.word("camera_type");
  const std::array<double, 4> f{k.number("fx"), k.number("fy"), k.number("cx"), k.number("cy")};
  const auto lens = [&](const std::string& model, const std::vector<double>& sphere) {
    return make_camera(k.where(), {"none", f, {}, width, height, model, sphere});
  };
  const auto distorted = [&](const NamedDistortion& distortion) {
    return make_camera(k.where(), {distortion.name, f, distortion.coefficients, width, height});
  };
  if (type == "ds") return lens("ds", {k.number("xi"), k.number("alpha")});
  if (type == "eucm") return lens("eucm", {k.number("alpha"), k.number("beta")});
  if (type == "ucm") return lens("eucm", {k.number("alpha"), 1.0});  // the same for beta = 1
  if (type == "pinhole") return distorted({"none", {}});
  if (type == "kb4") return distorted(fisheye(k));
  if (type == "fov") return distorted({"fov", {k.number("w")}});
  if (type == "pinhole-radtan8") return distorted(brown(k));
  throw InputError(k.where(), "camera_type \"" + type +
                                  "\" is not supported: use ds, kb4, eucm, ucm, pinhole, pinhole-radtan8 or fov");
}

const Json& list_entry(const Json& root, const char* key, std::size_t index, const std::string& file) {
  const auto found = root.find(key);
  if (found == root.end() || !found->is_array() || index >= found->size())
    throw InputError(file, "\"" + std::string(key) + "\" must be a list with an entry for each camera");
  return found->at(index);
}

std::vector<NamedCalibration> read_basalt(const Json& root, const std::string& file) {
  const Json& rig = root.at("value0");
  std::vector<NamedCalibration> cameras;
  const std::size_t count = rig.contains("intrinsics") && rig["intrinsics"].is_array() ? rig["intrinsics"].size() : 0;
  for (std::size_t i = 0; i < count; ++i) {
    NamedCalibration next{"cam" + std::to_string(i), {}};
    const std::string where = file + ": " + next.name;
    const Json& size = list_entry(rig, "resolution", i, file);
    if (!size.is_array() || size.size() != 2 || !size[0].is_number() || !size[1].is_number())
      throw InputError(where, "\"resolution\" must be width and height");
    const auto [width, height] =
        checked_image_size(std::array{size[0].get<double>(), size[1].get<double>()}, "resolution", where);
    const Json& entry = list_entry(rig, "intrinsics", i, file);
    const JsonCamera camera(entry, where);
    if (!camera.has("intrinsics")) throw InputError(where, "the camera has no key \"intrinsics\"");
    next.calibration.camera = read_basalt_lens(camera, JsonCamera(entry.at("intrinsics"), where), width, height);
    next.calibration.T_cam_imu =
        read_basalt_pose(JsonCamera(list_entry(rig, "T_imu_cam", i, file), where + ": T_imu_cam")).inverse();
    cameras.push_back(std::move(next));
  }
  if (cameras.empty()) throw InputError(file, "has no camera in \"intrinsics\"");
  return cameras;
}

// ---- nerfstudio ----

/// Throws InputError if images have lenses of their own.
void require_one_lens(const Json& root, const std::string& file) {
  const auto frames = root.find("frames");
  if (frames == root.end() || !frames->is_array()) return;
  for (const Json& frame : *frames)
    if (frame.is_object() && (frame.contains("fl_x") || frame.contains("camera_model")))
      throw InputError(file,
                       "states the lens for each image (\"frames\"): keep one for all at the top level (fl_x, fl_y, "
                       "cx, cy, w, h)");
}

std::vector<NamedCalibration> read_nerfstudio(const Json& root, const std::string& file) {
  require_one_lens(root, file);
  const JsonCamera camera(root, file);
  const std::string model = camera.has("camera_model") ? camera.word("camera_model") : "OPENCV";
  const auto [width, height] = camera.size("w", "h");
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  if (model == "EQUIRECTANGULAR") {
    calibration.camera = make_panorama(width, height);
    return {{"", calibration}};
  }
  constexpr double kPixelCentre = 0.5;
  double focal_x = 0.0;
  if (camera.has("fl_x")) {
    focal_x = camera.number("fl_x");
  } else if (camera.has("camera_angle_x")) {
    focal_x = 0.5 * width / std::tan(0.5 * camera.number("camera_angle_x"));
  } else {
    throw InputError(file, "the camera has no key \"fl_x\"");
  }
  const std::array<double, 4> intrinsics{focal_x, camera.number_or("fl_y", focal_x),
                                         camera.number_or("cx", 0.5 * width) - kPixelCentre,
                                         camera.number_or("cy", 0.5 * height) - kPixelCentre};
  NamedDistortion distortion;
  if (model == "OPENCV_FISHEYE") {
    distortion = fisheye(camera);
  } else if (model == "OPENCV" || model == "PINHOLE" || model == "SIMPLE_PINHOLE" || model == "SIMPLE_RADIAL" ||
             model == "RADIAL") {
    camera.require_zero({"k4"}, model);
    distortion = brown(camera);
  } else {
    throw InputError(file, "camera_model \"" + model +
                               "\" is not supported: use OPENCV, OPENCV_FISHEYE, PINHOLE or EQUIRECTANGULAR");
  }
  calibration.camera = make_camera(file, {distortion.name, intrinsics, distortion.coefficients, width, height});
  return {{"", calibration}};
}

bool is_opensfm(const Json& root) {
  return root.is_object() && !root.empty() && root.begin()->is_object() && root.begin()->contains("projection_type");
}

}  // namespace

std::vector<NamedCalibration> read_json_calibrations(const std::filesystem::path& file) {
  const std::string name = file.string();
  const std::string bytes = base::read_text(file, kMaxJsonBytes);
  Json root;
  try {
    root = Json::parse(bytes);
  } catch (const Json::exception& error) {
    throw InputError(name, "is not valid JSON: " + std::string(error.what()));
  }
  if (root.is_object() && root.contains("value0") && root["value0"].is_object()) return read_basalt(root, name);
  if (root.is_object() && (root.contains("fl_x") || root.contains("camera_angle_x") || root.contains("frames")))
    return read_nerfstudio(root, name);
  // reconstruction.json: a list of reconstructions, each with its cameras
  if (root.is_array() && !root.empty() && root[0].is_object() && root[0].contains("cameras")) {
    const Json& cameras = root[0]["cameras"];
    if (is_opensfm(cameras)) return read_opensfm(cameras, name);
  }
  if (is_opensfm(root)) return read_opensfm(root, name);
  if (root.is_object() && root.contains("fisheye_params"))
    throw InputError(
        name,
        "is a lens profile of Gyroflow, which is not read: write its camera_matrix and distortion_coeffs into "
        "a file as OpenCV's, with distortion_model: equidistant, and calib_dimension as image_width and "
        "image_height (docs/formats.md, Calibration files)");
  throw InputError(name,
                   "is JSON, but no calibration that is known: expected OpenSfM's or OpenDroneMap's cameras.json, "
                   "basalt's calibration.json or nerfstudio's transforms.json");
}

}  // namespace tileflight::imaging
