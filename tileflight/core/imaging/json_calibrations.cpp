// Calibrations that other programs keep as JSON:
//   OpenSfM and OpenDroneMap, camera_models.json and cameras.json: https://opensfm.org/docs/cam_coord_system.html;
//     numbers are shares of the larger side of the image, and the principal point is relative to the image's centre;
//   basalt, calibration.json: https://gitlab.com/VladyslavUsenko/basalt/-/blob/master/doc/Calibration.md;
//   nerfstudio and instant-ngp, transforms.json: https://docs.nerf.studio/quickstart/data_conventions.html; pixel
//     centres are at halves;
//   Gyroflow, lens profiles: lens_profile.h.
#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/lens_profile.h"

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

  bool truth_or(const char* key, bool other) const {
    if (!has(key)) return other;
    if (!object_.at(key).is_boolean()) throw InputError(where_, "\"" + std::string(key) + "\" must be true or false");
    return object_.at(key).get<bool>();
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

/// A panorama whose pixels have these sizes, pixels per radian.
Camera panorama_part(const std::string& where, const std::array<double, 4>& intrinsics, int width, int height) {
  return make_camera(where, {"none", intrinsics, {}, width, height, "equirectangular"});
}

// ---- OpenSfM ----

/// A projection type of OpenSfM and its coefficients; its program reads no others of that type (opensfm/io.py).
struct OpenSfmLens {
  const char* type;
  bool is_fisheye;
  std::vector<std::string> coefficients;
  bool has_centre = true;  ///< c_x and c_y; otherwise the image's centre
};

const OpenSfmLens* find_opensfm_lens(const std::string& type) {
  static const std::vector<OpenSfmLens> kLenses{
      {"perspective", false, {"k1", "k2"}, false},
      {"simple_radial", false, {"k1"}},
      {"radial", false, {"k1", "k2"}},
      {"brown", false, {"k1", "k2", "k3", "p1", "p2"}},
      {"fisheye", true, {"k1", "k2"}, false},
      {"fisheye_opencv", true, {"k1", "k2", "k3", "k4"}},
      {"fisheye62", true, {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2"}},
      {"fisheye624", true, {"k1", "k2", "k3", "k4", "k5", "k6", "p1", "p2", "s0", "s1", "s2", "s3"}}};
  const auto lens = std::ranges::find_if(kLenses, [&](const OpenSfmLens& known) { return known.type == type; });
  return lens == kLenses.end() ? nullptr : &*lens;
}

/// Throws InputError if a camera states a number that its projection type does not have.
void require_own_numbers(const JsonCamera& camera, const OpenSfmLens& lens) {
  constexpr std::array<const char*, 14> kAll{"k1", "k2", "k3", "k4", "k5", "k6",  "p1",
                                             "p2", "s0", "s1", "s2", "s3", "c_x", "c_y"};
  for (const std::string key : kAll) {
    const bool is_centre = key.starts_with("c_");
    const bool is_known = is_centre ? lens.has_centre : std::ranges::count(lens.coefficients, key) > 0;
    if (!is_known && camera.number_or(key.c_str(), 0.0) != 0.0)
      throw InputError(camera.where(), "\"" + key + "\" is not 0, but OpenSfM's projection_type \"" + lens.type +
                                           "\" has no such number: give the type that the numbers are of");
  }
}

Calibration read_opensfm_camera(const JsonCamera& camera) {
  const std::string type = camera.word("projection_type");
  const auto [width, height] = camera.size("width", "height");
  const double larger = std::max(width, height);
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  if (type == "spherical" || type == "equirectangular") {
    const double pixels_per_rad = larger / (2.0 * std::numbers::pi);
    calibration.camera = panorama_part(
        camera.where(), {pixels_per_rad, pixels_per_rad, 0.5 * (width - 1), 0.5 * (height - 1)}, width, height);
    return calibration;
  }
  const OpenSfmLens* lens = find_opensfm_lens(type);
  if (lens == nullptr)
    throw InputError(camera.where(),
                     "projection_type \"" + type +
                         "\" is not supported: use perspective, brown, simple_radial, radial, fisheye, fisheye_opencv "
                         "or spherical");
  require_own_numbers(camera, *lens);
  const double focal_x = camera.has("focal_x") ? camera.number("focal_x") : camera.number("focal");
  const double focal_y = camera.has("focal_y") ? camera.number("focal_y") : focal_x;
  // OpenSfM's coordinates are (pixel + 0.5 - width / 2) / larger side, with pixel centres at integers.
  const std::array<double, 4> intrinsics{focal_x * larger, focal_y * larger,
                                         0.5 * (width - 1) + camera.number_or("c_x", 0.0) * larger,
                                         0.5 * (height - 1) + camera.number_or("c_y", 0.0) * larger};
  if (lens->is_fisheye) camera.require_zero({"k5", "k6", "p1", "p2", "s0", "s1", "s2", "s3"}, type);
  const NamedDistortion distortion = lens->is_fisheye ? fisheye(camera) : brown(camera);
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

/// basalt adds cam_time_offset_ns to the times of the images, which puts them on the IMU's clock.
void note_basalt_time_offset(const Json& rig, const std::string& file, Calibration& calibration) {
  constexpr double kSecondsPerNs = 1e-9;
  const double shift_s = JsonCamera(rig, file).number_or("cam_time_offset_ns", 0.0) * kSecondsPerNs;
  if (shift_s != 0.0)
    calibration.notes.push_back(file +
                                ": cam_time_offset_ns is not applied to the readings of an inertial unit; "
                                "give --imu-time-offset " +
                                format_number(-shift_s));
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
    note_basalt_time_offset(rig, file, next.calibration);
    cameras.push_back(std::move(next));
  }
  if (cameras.empty()) throw InputError(file, "has no camera in \"intrinsics\"");
  return cameras;
}

// ---- nerfstudio ----

/// Throws InputError if images have lenses of their own.
void require_one_lens(const Json& root, const std::string& file) {
  constexpr std::array<const char*, 16> kLensKeys{
      "camera_model", "fl_x", "fl_y", "camera_angle_x", "camera_angle_y", "cx", "cy", "w", "h", "k1", "k2", "k3",
      "k4",           "p1",   "p2",   "is_fisheye"};
  const auto frames = root.find("frames");
  if (frames == root.end() || !frames->is_array()) return;
  for (const Json& frame : *frames)
    for (const std::string key : kLensKeys)
      if (frame.is_object() && frame.contains(key) && (!root.contains(key) || root[key] != frame[key]))
        throw InputError(file, "states the lens for each image (\"" + key +
                                   "\" in \"frames\"): keep one for all at the top level (fl_x, fl_y, cx, cy, w, h)");
}

/// Focal length along a side of `pixels`: its own key, or the angle of view; nullopt if neither is stated.
std::optional<double> nerf_focal(const JsonCamera& camera, const char* key, const char* angle_key, int pixels) {
  if (camera.has(key)) return camera.number(key);
  if (camera.has(angle_key)) return 0.5 * pixels / std::tan(0.5 * camera.number(angle_key));
  return std::nullopt;
}

/// A file that was edited or resized may state both, and fl_x decides.
void note_other_angle(const JsonCamera& camera, double focal_x, int width, Calibration& calibration) {
  constexpr double kRounding = 0.01;
  if (!camera.has("fl_x") || !camera.has("camera_angle_x")) return;
  const double by_angle = 0.5 * width / std::tan(0.5 * camera.number("camera_angle_x"));
  if (std::abs(by_angle / focal_x - 1.0) <= kRounding) return;
  calibration.notes.push_back(camera.where() + ": fl_x is " + format_number(focal_x) +
                              " pixels, camera_angle_x gives " + base::rounded_text(by_angle, 1) + "; fl_x is used");
}

/// k1 k2 k3 k4 p1 p2. A list "distortion_params" has precedence in nerfstudio.
std::array<double, 6> nerf_coefficients(const Json& root, const JsonCamera& camera) {
  std::array<double, 6> values{};
  const auto list = root.find("distortion_params");
  if (list == root.end()) {
    std::ranges::copy(camera.numbers_or_zero({"k1", "k2", "k3", "k4", "p1", "p2"}), values.begin());
    return values;
  }
  if (!list->is_array() || list->size() != values.size() ||
      !std::ranges::all_of(*list, [](const Json& value) { return value.is_number(); }))
    throw InputError(camera.where(), "\"distortion_params\" must be the six numbers k1 k2 k3 k4 p1 p2");
  std::ranges::transform(*list, values.begin(), [](const Json& value) { return value.get<double>(); });
  return values;
}

/// nerfstudio's model; instant-ngp has none, but a word for a fisheye.
std::string nerf_model(const JsonCamera& camera) {
  for (const char* key : {"ftheta_p0", "latlong", "halflatlong", "equirectangular"})
    if (camera.has(key))
      throw InputError(camera.where(), "instant-ngp's lens of \"" + std::string(key) +
                                           "\" is not supported: use its fisheye (\"is_fisheye\") or pinhole");
  const bool is_fisheye = camera.truth_or("is_fisheye", false);
  const std::string model =
      camera.has("camera_model") ? camera.word("camera_model") : std::string(is_fisheye ? "OPENCV_FISHEYE" : "OPENCV");
  if (is_fisheye && model != "OPENCV_FISHEYE")
    throw InputError(camera.where(), "\"is_fisheye\" is true, but camera_model is \"" + model + "\": remove one");
  return model;
}

NamedDistortion nerf_distortion(const std::string& model, const std::array<double, 6>& k, const std::string& file) {
  const auto refuse_unless_zero = [&](double value, const char* name) {
    if (value != 0.0)
      throw InputError(file, "\"" + std::string(name) + "\" of the model \"" + model +
                                 "\" is not 0, which no lens model here has: undistort the images, or calibrate "
                                 "without it");
  };
  if (model == "OPENCV_FISHEYE") {
    refuse_unless_zero(k[4], "p1");
    refuse_unless_zero(k[5], "p2");
    return {"equidistant", {k[0], k[1], k[2], k[3]}};
  }
  refuse_unless_zero(k[3], "k4");  // of r^8; OpenCV's k4 is one of a denominator
  return parse_opencv_distortion(file + ": k1 to p2", std::array{k[0], k[1], k[4], k[5], k[2]});
}

std::vector<NamedCalibration> read_nerfstudio(const Json& root, const std::string& file) {
  require_one_lens(root, file);
  const JsonCamera camera(root, file);
  const std::string model = nerf_model(camera);
  const auto [width, height] = camera.size("w", "h");
  Calibration calibration;
  calibration.assumes_T_cam_imu = true;
  constexpr double kPixelCentre = 0.5;
  const double cx = camera.number_or("cx", 0.5 * width) - kPixelCentre;
  const double cy = camera.number_or("cy", 0.5 * height) - kPixelCentre;
  if (model == "EQUIRECTANGULAR") {  // nerfstudio's Cameras: longitude = pi (x - cx) / fl_x, latitude likewise
    const double fx = camera.number_or("fl_x", 0.5 * width), fy = camera.number_or("fl_y", height);
    calibration.camera = panorama_part(file, {fx / std::numbers::pi, fy / std::numbers::pi, cx, cy}, width, height);
    return {{"", calibration}};
  }
  constexpr std::array<std::string_view, 6> kModels{"OPENCV",         "OPENCV_FISHEYE", "PINHOLE",
                                                    "SIMPLE_PINHOLE", "SIMPLE_RADIAL",  "RADIAL"};
  if (std::ranges::find(kModels, model) == kModels.end())
    throw InputError(file, "camera_model \"" + model +
                               "\" is not supported: use OPENCV, OPENCV_FISHEYE, PINHOLE or EQUIRECTANGULAR");
  const std::optional<double> x = nerf_focal(camera, "fl_x", "camera_angle_x", width);
  const std::optional<double> y = nerf_focal(camera, "fl_y", "camera_angle_y", height);
  if (!x && !y) throw InputError(file, "the camera has no key \"fl_x\"");
  const std::array<double, 4> intrinsics{x ? *x : *y, y ? *y : *x, cx, cy};
  note_other_angle(camera, intrinsics[0], width, calibration);
  const NamedDistortion distortion = nerf_distortion(model, nerf_coefficients(root, camera), file);
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
    return {{"", calibration_of(parse_lens_profile(bytes, name))}};
  throw InputError(name,
                   "is JSON, but no calibration that is known: expected OpenSfM's or OpenDroneMap's cameras.json, "
                   "basalt's calibration.json, nerfstudio's transforms.json or a lens profile of Gyroflow");
}

}  // namespace tileflight::imaging
