// Kalibr's camchain YAML: https://github.com/ethz-asl/kalibr/wiki/yaml-formats and /supported-models.
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging {

namespace {

/// The preceding camera in the chain: "cam0" for "cam1"; empty: there is none.
std::string camera_before(const std::string& camera_id) {
  const auto number =
      base::parse_number<int>(std::string_view(camera_id).substr(std::min<std::size_t>(3, camera_id.size())));
  return number && *number > 0 ? "cam" + std::to_string(*number - 1) : "";
}

/// T_cam_imu of the camera itself, or of the preceding camera combined with T_cn_cnm1 (from that camera to this one).
void read_chain_extrinsics(const YAML::Node& root, const std::string& camera_id, const std::string& file,
                           Calibration& calibration) {
  geometry::SE3 T_cam_that;
  for (std::string id = camera_id; !id.empty() && root[id]; id = camera_before(id)) {
    const YAML::Node camera = root[id];
    calibration.assumes_T_cam_imu = false;
    read_extrinsics(camera, file, calibration);
    calibration.T_cam_imu = T_cam_that * calibration.T_cam_imu;
    if (!calibration.assumes_T_cam_imu) return;
    if (!camera["T_cn_cnm1"]) break;
    T_cam_that = T_cam_that * yaml_rigid_motion(camera["T_cn_cnm1"], "T_cn_cnm1", file);
  }
  calibration.T_cam_imu = {};
}

Camera read_lens(const YAML::Node& camera, const std::string& file) {
  const auto model = yaml_scalar<std::string>(required_value(camera, "camera_model", file), "camera_model", file);
  const std::size_t sphere = sphere_parameter_count(file, model);
  const YAML::Node distortion_node = sphere == 2 || model == "equirectangular"
                                         ? camera["distortion_model"]
                                         : required_value(camera, "distortion_model", file);
  const auto distortion =
      distortion_node ? yaml_scalar<std::string>(distortion_node, "distortion_model", file) : "none";
  const std::vector<double> intrinsics = yaml_numbers(required_value(camera, "intrinsics", file), "intrinsics", file);
  const YAML::Node coefficient_node = camera["distortion_coeffs"];
  std::vector<double> coefficients;
  if (coefficient_node) coefficients = yaml_numbers(coefficient_node, "distortion_coeffs", file);
  const auto [width, height] = checked_image_size(
      yaml_numbers(required_value(camera, "resolution", file), "resolution", file), "resolution", file);
  const std::span<const double> all = intrinsics;
  const std::size_t before = std::min(sphere, all.size());
  return make_camera(file, {distortion, all.subspan(before), coefficients, width, height, model, all.first(before)});
}

double read_line_delay(const YAML::Node& camera, const std::string& file) {
  const YAML::Node node = camera["line_delay"];
  if (!node) return 0.0;
  const double delay = yaml_scalar<double>(node, "line_delay", file);
  constexpr double kLimit_s = 0.1;
  if (!(std::abs(delay) < kLimit_s)) throw InputError(file, "\"line_delay\" must be less than 0.1 s, up or down");
  return delay;
}

std::string distortion_lines(const std::string& name, const std::string& coefficients) {
  return "  distortion_model: " + name + "\n  distortion_coeffs: " + coefficients + "\n";
}

std::string radtan_lines(const std::array<double, 4>& d) {
  return distortion_lines("radtan", number_list({d[0], d[1], d[2], d[3]}));
}

/// camera_model, intrinsics and distortion.
std::string lens_lines(const std::string& model, std::initializer_list<double> intrinsics,
                       const std::string& distortion) {
  return "  camera_model: " + model + "\n  intrinsics: " + number_list(intrinsics) + "\n" + distortion;
}
std::string lens_lines(const PinholeRadtan& m) {
  return lens_lines("pinhole", {m.fx, m.fy, m.cx, m.cy}, radtan_lines(m.d));
}
std::string lens_lines(const PinholeRational& m) {
  return lens_lines("pinhole", {m.fx, m.fy, m.cx, m.cy}, distortion_lines("rational", number_list(m.d)));
}
std::string lens_lines(const Equirectangular& m) {
  return lens_lines("equirectangular", {m.fx, m.fy, m.cx, m.cy}, distortion_lines("none", "[]"));
}
std::string lens_lines(const KannalaBrandt& m) {
  return lens_lines("pinhole", {m.fx, m.fy, m.cx, m.cy},
                    distortion_lines("equidistant", number_list({m.k[0], m.k[1], m.k[2], m.k[3]})));
}
std::string lens_lines(const FovModel& m) {
  return lens_lines("pinhole", {m.fx, m.fy, m.cx, m.cy}, distortion_lines("fov", number_list({m.w})));
}
std::string lens_lines(const DoubleSphere& m) {
  return lens_lines("ds", {m.xi, m.alpha, m.fx, m.fy, m.cx, m.cy}, distortion_lines("none", "[]"));
}
std::string lens_lines(const UnifiedModel& m) {
  return lens_lines("omni", {m.xi, m.fx, m.fy, m.cx, m.cy}, radtan_lines(m.d));
}
std::string lens_lines(const ExtendedUnifiedModel& m) {
  return lens_lines("eucm", {m.alpha, m.beta, m.fx, m.fy, m.cx, m.cy}, distortion_lines("none", "[]"));
}

std::string transform_lines(const std::string& key, const geometry::SE3& T) {
  const geometry::Mat3 r = T.rotation.toRotationMatrix();
  std::string text = "  " + key + ":\n";
  for (int row = 0; row < 3; ++row)
    text += "  - " + number_list({r(row, 0), r(row, 1), r(row, 2), T.translation[row]}) + "\n";
  return text + "  - " + number_list({0, 0, 0, 1}) + "\n";
}

std::string camera_lines(const std::string& id, const Calibration& calibration) {
  const Camera& camera = calibration.camera;
  std::string text = id + ":\n" + std::visit([](const auto& m) { return lens_lines(m); }, camera.model());
  text += "  resolution: [" + std::to_string(camera.width()) + ", " + std::to_string(camera.height()) + "]\n";
  text += "  rostopic: /" + id + "/image_raw\n";
  if (!calibration.assumes_T_cam_imu) text += transform_lines("T_cam_imu", calibration.T_cam_imu);
  if (calibration.line_delay_s != 0.0) text += "  line_delay: " + format_number(calibration.line_delay_s) + "\n";
  return text;
}

/// Sections cam0, cam1, ... of a camchain.
std::size_t count_chain_cameras(const YAML::Node& root) {
  if (!root.IsMap()) return 0;
  std::size_t count = 0;
  for (const auto& entry : root) {
    if (!entry.first.IsScalar() || !entry.second.IsMap()) continue;
    const std::string& key = entry.first.Scalar();
    const bool is_numbered = key.size() > 3 && key.find_first_not_of("0123456789", 3) == std::string::npos;
    count += key.starts_with("cam") && is_numbered ? 1 : 0;
  }
  return count;
}

/// t_imu = t_cam + shift (github.com/ethz-asl/kalibr/wiki/yaml-formats).
double read_timeshift(const YAML::Node& camera, const std::string& file) {
  const YAML::Node node = camera["timeshift_cam_imu"];
  if (!node) return 0.0;
  constexpr double kMost_s = 1.0;
  const double shift_s = yaml_scalar<double>(node, "timeshift_cam_imu", file);
  if (!(std::abs(shift_s) <= kMost_s))
    throw InputError(file, "\"timeshift_cam_imu\" is " + format_number(shift_s) +
                               ": it must be in seconds, at most one second either way");
  return shift_s;
}

/// Kalibr writes both transforms; files put together by hand may not agree.
void require_agreement(const geometry::SE3& by_chain, const geometry::SE3& by_imu, const std::string& file) {
  constexpr double kRounding_m = 0.01, kRounding_rad = 0.01;
  const geometry::SE3 between = by_chain.inverse() * by_imu;
  const bool agrees = between.translation.norm() <= kRounding_m &&
                      between.rotation.angularDistance(Eigen::Quaterniond::Identity()) <= kRounding_rad;
  if (!agrees)
    throw InputError(file, "\"T_cn_cnm1\" and \"T_cam_imu\" put the camera at different places: keep the right one");
}

/// Translations in millimetres are the usual mistake of files put together by hand.
void require_on_one_body(const geometry::SE3& T, const std::string& key, const std::string& other,
                         const std::string& file) {
  constexpr double kFarthest_m = 10.0;
  const double distance_m = T.translation.norm();
  if (distance_m <= kFarthest_m) return;
  throw InputError(file, "\"" + key + "\" puts the camera " + base::rounded_text(distance_m, 1) + " m from " + other +
                             ", too far for one body: translations are in metres, not millimetres");
}

/// Throws InputError if a camchain of another program puts a camera too far from the one before or from the IMU.
/// `is_first`: T_cn_cnm1 has no meaning for this camera.
void require_probable(const YAML::Node& camera, bool is_first, const std::string& file) {
  if (camera["T_body_cam"]) return;  // written here: a flight may have whatever rig it asks for
  if (!is_first && camera["T_cn_cnm1"])
    require_on_one_body(yaml_rigid_motion(camera["T_cn_cnm1"], "T_cn_cnm1", file), "T_cn_cnm1", "the one before", file);
  if (camera["T_cam_imu"])
    require_on_one_body(yaml_rigid_motion(camera["T_cam_imu"], "T_cam_imu", file), "T_cam_imu", "the IMU", file);
}

/// Pose of a camera in the frame of the one before it. `T_cam_imu`: of both.
geometry::SE3 pose_in_chain(const YAML::Node& camera, const YAML::Node& before, const geometry::SE3& T_cam_imu,
                            const geometry::SE3& T_before_imu, const std::string& file) {
  const bool has_chain = camera["T_cn_cnm1"].IsDefined();
  const bool has_imu = states_extrinsics(camera) && states_extrinsics(before);
  if (!has_chain && !has_imu)
    throw InputError(file, "neither \"T_cn_cnm1\" nor \"T_cam_imu\" of both says where it is beside the one before");
  const geometry::SE3 by_imu = T_before_imu * T_cam_imu.inverse();
  if (!has_chain) return by_imu;
  const geometry::SE3 by_chain = yaml_rigid_motion(camera["T_cn_cnm1"], "T_cn_cnm1", file).inverse();
  if (has_imu) require_agreement(by_chain, by_imu, file);
  return by_chain;
}

}  // namespace

Calibration read_kalibr(const std::filesystem::path& file) { return read_kalibr_camera(file, "cam0"); }

Calibration read_kalibr_camera(const std::filesystem::path& file, const std::string& camera_id) {
  const YAML::Node root = load_calibration_yaml(file);
  if (!root.IsMap() || !root[camera_id] || !root[camera_id].IsMap())
    throw InputError(file.string(), "has no camera \"" + camera_id + "\"" +
                                        (camera_id == "cam0" ? ": this is not a Kalibr camchain" : ""));
  const YAML::Node camera = root[camera_id];
  const std::string name = file.string() + (camera_id == "cam0" ? "" : ": " + camera_id);
  Calibration calibration;
  calibration.camera = read_lens(camera, name);
  read_chain_extrinsics(root, camera_id, name, calibration);
  calibration.line_delay_s = read_line_delay(camera, name);
  constexpr std::array<std::string_view, 13> kKnown{
      "camera_model", "intrinsics", "distortion_model",  "distortion_coeffs", "resolution",
      "rostopic",     "T_cn_cnm1",  "timeshift_cam_imu", "cam_overlaps",      "line_delay",
      "name",         "folder",     "T_body_cam"};
  note_unused_keys(camera, kKnown, name, calibration);
  return calibration;
}

std::vector<ChainCamera> read_camchain(const std::filesystem::path& file) {
  const YAML::Node root = load_calibration_yaml(file);
  const std::size_t named = count_chain_cameras(root);
  if (named == 0) throw InputError(file.string(), "has no camera \"cam0\": this is not a Kalibr camchain");
  std::vector<ChainCamera> cameras;
  geometry::SE3 T_first_cam;
  YAML::Node before;
  while (cameras.size() < named) {
    const std::string id = "cam" + std::to_string(cameras.size());
    const std::string where = file.string() + ": " + id;
    ChainCamera next{id, {}, read_kalibr_camera(file, id), {}, 0.0};
    const YAML::Node camera = root[id];
    require_probable(camera, cameras.empty(), where);
    if (!cameras.empty())
      T_first_cam = T_first_cam * pose_in_chain(camera, before, next.calibration.T_cam_imu,
                                                cameras.back().calibration.T_cam_imu, where);
    before.reset(camera);
    next.T_body_cam = camera["T_body_cam"] ? yaml_rigid_motion(camera["T_body_cam"], "T_body_cam", where) : T_first_cam;
    next.timeshift_cam_imu_s = read_timeshift(camera, where);
    if (camera["name"]) next.name = yaml_scalar<std::string>(camera["name"], "name", where);
    if (camera["folder"]) next.folder = yaml_scalar<std::string>(camera["folder"], "folder", where);
    cameras.push_back(std::move(next));
  }
  return cameras;
}

void write_camchain(const std::filesystem::path& file, const std::vector<ChainCamera>& cameras) {
  std::string text;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const ChainCamera& camera = cameras[i];
    text += camera_lines("cam" + std::to_string(i), camera.calibration);
    if (i > 0) text += transform_lines("T_cn_cnm1", camera.T_body_cam.inverse() * cameras[i - 1].T_body_cam);
    if (camera.timeshift_cam_imu_s != 0.0)
      text += "  timeshift_cam_imu: " + format_number(camera.timeshift_cam_imu_s) + "\n";
    if (!camera.name.empty()) text += "  name: " + camera.name + "\n";
    if (!camera.folder.empty()) text += "  folder: " + camera.folder.string() + "\n";
    text += transform_lines("T_body_cam", camera.T_body_cam);
  }
  base::write_file(file, text);
}

void write_kalibr(const std::filesystem::path& file, const Calibration& calibration) {
  base::write_file(file, camera_lines("cam0", calibration));
}

}  // namespace tileflight::imaging
