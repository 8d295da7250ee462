// A sequence of VSLAM-LAB in its present form, as read by vslam_lab_layout.cpp. The body is the camera rgb_0, so that
// groundtruth.csv has its poses whether a program takes them for the body's or for the camera's.
#include <algorithm>
#include <array>
#include <cmath>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_layers.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

/// Whether VSLAM-LAB finds images of this kind.
bool is_listed_kind(const dataset::Frame& frame) {
  const std::string ending = base::to_lower(frame.image.extension().string());
  return ending == ".png" || ending == ".jpg" || ending == ".jpeg";
}

bool is_gray(const imaging::RgbImage& image) {
  return std::ranges::all_of(image.pixels, [](const auto& p) { return p[0] == p[1] && p[1] == p[2]; });
}

std::string motion_text(const geometry::SE3& T) {
  const geometry::Mat4 m = T.matrix();
  std::string text = "[";
  for (int i = 0; i < 16; ++i) text += (i > 0 ? ", " : "") + imaging::format_number(m(i / 4, i % 4));
  return text + "]";
}

/// `T_BS`: of a camera whose images are in the folder `name`.
std::string camera_text(const dataset::Dataset& dataset, const std::string& name, const geometry::SE3& T_BS,
                        double depth_units_per_m) {
  const auto lens = imaging::vslam_lab_lens_text(dataset.calibration.camera);
  if (!lens)
    throw InputError(dataset.folder.string(),
                     "VSLAM-LAB's calibration.yaml cannot describe this lens; use a pinhole, radtan or equidistant "
                     "camera");
  const bool has_depth = depth_units_per_m > 0.0;
  const char* const kind = has_depth                                                  ? "rgb+depth"
                           : is_gray(imaging::read_rgb(dataset.frames.front().image)) ? "gray"
                                                                                      : "rgb";
  std::string text = "  - {cam_name: " + name + ",\n     cam_type: " + std::string(kind) + ",\n     ";
  if (has_depth)
    text += "depth_name: depth_0,\n     depth_factor: " + imaging::format_number(depth_units_per_m) + ",\n     ";
  return text + *lens + ",\n     fps: " + imaging::format_number(frame_rate_hz(dataset)) +
         ",\n     T_BS: " + motion_text(T_BS) + "\n    }\n";
}

/// The keys are OKVIS2's. What a dataset does not state are its usual priors; the ranges hold all readings.
std::string imu_text(const dataset::Dataset& dataset, const std::vector<geometry::ImuSample>& readings,
                     const dataset::ImuCalibration& noise) {
  double force_m_s2 = 176.0, rate_rad_s = 7.8;
  for (const geometry::ImuSample& reading : readings) {
    force_m_s2 = std::max(force_m_s2, std::ceil(1.25 * reading.specific_force_m_s2.cwiseAbs().maxCoeff()));
    rate_rad_s = std::max(rate_rad_s, std::ceil(1.25 * reading.angular_rate_rad_s.cwiseAbs().maxCoeff()));
  }
  std::string text = "\nimus:\n  - {imu_name: imu_0";
  const auto add = [&text](const char* key, double value) {
    text += ",\n     " + std::string(key) + ": " + imaging::format_number(value);
  };
  add("a_max", force_m_s2);
  add("g_max", rate_rad_s);
  add("sigma_g_c", noise.gyroscope_noise_density);
  add("sigma_gw_c", noise.gyroscope_random_walk);
  add("sigma_a_c", noise.accelerometer_noise_density);
  add("sigma_aw_c", noise.accelerometer_random_walk);
  add("sigma_bg", 0.01);
  add("sigma_ba", 0.1);
  text += ",\n     a0: [0.0, 0.0, 0.0],\n     g0: [0.0, 0.0, 0.0]";
  add("g", 9.80665);
  text += ",\n     s_a: [1.0, 1.0, 1.0]";
  add("fps", noise.update_rate_hz);
  return text + ",\n     T_BS: " + motion_text(dataset.calibration.T_cam_imu) + "\n    }\n";
}

void append_row(std::string& text, double time_s, std::initializer_list<double> numbers) {
  text += std::to_string(geometry::to_nanoseconds(time_s));
  for (const double number : numbers) {
    text += ',';
    base::append_number(text, number);
  }
  text += '\n';
}

std::string poses_csv(const geometry::Trajectory& trajectory) {
  std::string text = "ts (ns),tx (m),ty (m),tz (m),qx,qy,qz,qw\n";
  for (const geometry::StampedPose& pose : trajectory.poses) {
    const geometry::Vec3& p = pose.T_local_camera.translation;
    const Eigen::Quaterniond& q = pose.T_local_camera.rotation;
    append_row(text, pose.time_s, {p.x(), p.y(), p.z(), q.x(), q.y(), q.z(), q.w()});
  }
  return text;
}

std::string readings_csv(const std::vector<geometry::ImuSample>& readings) {
  std::string text = "ts (ns),wx (rad s^-1),wy (rad s^-1),wz (rad s^-1),ax (m s^-2),ay (m s^-2),az (m s^-2)\n";
  for (const geometry::ImuSample& reading : readings) {
    const geometry::Vec3& w = reading.angular_rate_rad_s;
    const geometry::Vec3& a = reading.specific_force_m_s2;
    append_row(text, reading.time_s, {w.x(), w.y(), w.z(), a.x(), a.y(), a.z()});
  }
  return text;
}

/// An image of the pair as it is listed: its time and its file.
std::string listed_image(const dataset::RigCamera& camera, std::size_t frame, const std::string& folder, bool as_png) {
  const dataset::Frame& one = camera.dataset.frames[frame];
  return std::to_string(geometry::to_nanoseconds(one.time_s + camera.timeshift_s)) + "," + folder + "/" +
         dataset::frame_id(frame) + (as_png ? ".png" : one.image.extension().string());
}

/// A line for each frame or, with two cameras, for each instant at which both took one.
std::string frames_csv(const dataset::Rig& rig, bool as_png, bool with_depth) {
  const bool is_pair = rig.cameras.size() > 1;
  const dataset::RigCamera& first = rig.cameras.front();
  std::vector<std::array<std::size_t, 2>> lines;
  if (is_pair) lines = stereo_pairs(rig);
  for (std::size_t i = 0; !is_pair && i < first.dataset.frames.size(); ++i) lines.push_back({i, i});
  std::string text = "ts_rgb_0 (ns),path_rgb_0";
  if (is_pair) text += ",ts_rgb_1 (ns),path_rgb_1";
  text += with_depth ? ",ts_depth_0 (ns),path_depth_0\n" : "\n";
  for (const auto& [left, right] : lines) {
    const std::string image = listed_image(first, left, "rgb_0", as_png);
    text += image;
    if (is_pair) text += "," + listed_image(rig.cameras[1], right, "rgb_1", as_png);
    const bool has_depth = with_depth && !first.dataset.frames[left].depth.empty();
    if (with_depth && !has_depth) text += ",,";
    if (has_depth) text += "," + image.substr(0, image.find(',')) + ",depth_0/" + dataset::frame_id(left) + ".png";
    text += '\n';
  }
  return text;
}

void write_depth_images(const dataset::Dataset& dataset, const fs::path& folder, double units_per_m) {
  fs::create_directories(folder);
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const auto depth_m = dataset::read_depth(dataset, dataset.frames[i]);
    if (!depth_m) continue;
    const std::vector<std::byte> png = imaging::encode_png(dataset::quantize_depth(*depth_m, units_per_m));
    base::write_file(folder / (dataset::frame_id(i) + ".png"), {reinterpret_cast<const char*>(png.data()), png.size()});
  }
}

}  // namespace

void write_vslam_lab(const dataset::Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                     const Progress& progress) {
  const dataset::Dataset& dataset = rig.cameras.front().dataset;
  note_cameras_left_out(rig, 2, notes);
  const double depth_units_per_m = dataset::finest_depth_units_per_m(dataset);
  std::string calibration = "%YAML 1.2\n---\ncameras:\n" + camera_text(dataset, "rgb_0", {}, depth_units_per_m);
  if (rig.cameras.size() > 1) {
    const geometry::SE3 T_first_second = rig.cameras[0].T_body_camera.inverse() * rig.cameras[1].T_body_camera;
    calibration += camera_text(rig.cameras[1].dataset, "rgb_1", T_first_second, 0.0);
  }
  if (!dataset.imu.empty()) {
    const std::vector<geometry::ImuSample> readings = dataset::read_imu_csv(dataset.imu);
    base::write_file(folder / "imu_0.csv", readings_csv(readings));
    if (dataset.imu_noise.empty())
      notes.push_back("the noise of the inertial unit is not known; calibration.yaml has no `imus`");
    else
      calibration += imu_text(dataset, readings, dataset::read_imu_noise(dataset.imu_noise));
  }
  base::write_file(folder / "calibration.yaml", calibration);
  if (dataset.groundtruth) base::write_file(folder / "groundtruth.csv", poses_csv(*dataset.groundtruth));
  const std::size_t cameras = std::min<std::size_t>(2, rig.cameras.size());
  const bool as_png = !std::all_of(
      rig.cameras.begin(), rig.cameras.begin() + static_cast<std::ptrdiff_t>(cameras),
      [](const dataset::RigCamera& camera) { return std::ranges::all_of(camera.dataset.frames, is_listed_kind); });
  base::write_file(folder / "rgb.csv", frames_csv(rig, as_png, depth_units_per_m > 0.0));
  if (depth_units_per_m > 0.0) {
    write_depth_images(dataset, folder / "depth_0", depth_units_per_m);
    notes.push_back("depth_0 has 16-bit depths in steps of 1/" + imaging::format_number(depth_units_per_m) + " m");
  }
  if (dataset.calibration.line_delay_s != 0.0)
    notes.push_back("calibration.yaml cannot store the rolling shutter; it is left out");
  for (std::size_t c = 0; c < cameras; ++c) {
    const fs::path images = folder / ("rgb_" + std::to_string(c));
    if (as_png)
      write_png_frames(rig.cameras[c].dataset, images, dataset::frame_id, progress);
    else
      copy_frames(rig.cameras[c].dataset, images, dataset::frame_id, progress);
  }
}

}  // namespace tileflight::exports
