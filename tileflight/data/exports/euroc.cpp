// EuRoC's ASL layout (Burri et al., IJRR 2016), as read by euroc_layout.cpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <variant>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/exports/layout_writers.h"

namespace tileflight::exports {

namespace {

namespace fs = std::filesystem;

struct EurocLens {
  std::string distortion;
  std::array<double, 4> focal, coefficients;
};

EurocLens euroc_lens(const dataset::Dataset& dataset) {
  const imaging::CameraModel& model = dataset.calibration.camera.model();
  if (const auto* m = std::get_if<imaging::PinholeRadtan>(&model))
    return {"radial-tangential", {m->fx, m->fy, m->cx, m->cy}, m->d};
  if (const auto* m = std::get_if<imaging::KannalaBrandt>(&model))
    return {"equidistant", {m->fx, m->fy, m->cx, m->cy}, m->k};
  throw InputError(dataset.folder.string(),
                   "EuRoC's sensor.yaml cannot describe this lens; use a radtan or an equidistant camera");
}

template <class Numbers>
std::string list_text(const Numbers& numbers) {
  std::string text = "[";
  for (const double number : numbers) {
    if (text.size() > 1) text += ", ";
    base::append_number(text, number);
  }
  return text + "]";
}

/// `T_BS`: sensor to body, where the body is the IMU.
std::string head_text(const std::string& kind, const geometry::SE3& T_BS) {
  const geometry::Mat4 m = T_BS.matrix();
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = m;
  return "%YAML:1.0\nsensor_type: " + kind + "\ncomment: simulated or exported by tileflight\n" +
         "T_BS:\n  cols: 4\n  rows: 4\n  data: " + list_text(std::span<const double>(rows.data(), 16)) + "\n";
}

std::string rate_text(double rate_hz) {
  std::string text = "rate_hz: ";
  base::append_number(text, rate_hz);
  return text + "\n";
}

/// Returns a frame's time on the clock of the body, in nanoseconds.
std::string stamp_of(const dataset::RigCamera& camera, std::size_t frame) {
  return std::to_string(geometry::to_nanoseconds(camera.dataset.frames[frame].time_s + camera.timeshift_s));
}

void write_camera(const dataset::RigCamera& rig_camera, const fs::path& folder) {
  const dataset::Dataset& dataset = rig_camera.dataset;
  const EurocLens lens = euroc_lens(dataset);
  const imaging::Camera& camera = dataset.calibration.camera;
  fs::create_directories(folder);
  base::write_file(folder / "sensor.yaml",
                   head_text("camera", dataset.calibration.T_cam_imu.inverse()) + rate_text(frame_rate_hz(dataset)) +
                       "resolution: [" + std::to_string(camera.width()) + ", " + std::to_string(camera.height()) +
                       "]\ncamera_model: pinhole\nintrinsics: " + list_text(lens.focal) + "\ndistortion_model: " +
                       lens.distortion + "\ndistortion_coefficients: " + list_text(lens.coefficients) + "\n");
  std::string list = "#timestamp [ns],filename\n";
  for (std::size_t i = 0; i < dataset.frames.size(); ++i) {
    const std::string name = stamp_of(rig_camera, i);
    list += name + "," + name + ".png\n";
  }
  base::write_file(folder / "data.csv", list);
}

void write_imu(const dataset::Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes) {
  fs::create_directories(folder);
  dataset::write_imu_csv(folder / "data.csv", dataset::read_imu_csv(dataset.imu));
  if (dataset.imu_noise.empty()) {
    notes.push_back("the noise of the inertial unit is not known; mav0/imu0/sensor.yaml is left out");
    return;
  }
  const dataset::ImuCalibration imu = dataset::read_imu_noise(dataset.imu_noise);
  std::string text = head_text("imu", {}) + rate_text(imu.update_rate_hz);
  const auto line = [&text](const char* key, double value) {
    text += key;
    base::append_number(text, value);
    text += '\n';
  };
  line("gyroscope_noise_density: ", imu.gyroscope_noise_density);
  line("gyroscope_random_walk: ", imu.gyroscope_random_walk);
  line("accelerometer_noise_density: ", imu.accelerometer_noise_density);
  line("accelerometer_random_walk: ", imu.accelerometer_random_walk);
  base::write_file(folder / "sensor.yaml", text);
}

std::vector<geometry::StampedPose> body_poses(const dataset::RigCamera& camera) {
  std::vector<geometry::StampedPose> poses = camera.dataset.groundtruth->poses;
  for (geometry::StampedPose& pose : poses) {
    pose.T_local_camera = pose.T_local_camera * camera.dataset.calibration.T_cam_imu;
    pose.time_s += camera.timeshift_s;
  }
  return poses;
}

/// Derivative at pose `at` of the interpolating polynomial through the neighbouring positions (Lagrange, five of them
/// or as many as there are): sum over j of p_j l_j'(t).
geometry::Vec3 velocity_at(std::span<const geometry::StampedPose> poses, std::size_t at) {
  constexpr std::size_t kNodes = 5;
  const std::size_t count = std::min(kNodes, poses.size());
  const std::size_t first = std::min(at - std::min(at, count / 2), poses.size() - count);
  const auto nodes = poses.subspan(first, count);
  const double t = poses[at].time_s;
  geometry::Vec3 velocity = geometry::Vec3::Zero();
  for (std::size_t j = 0; j < count; ++j) {
    double slope = 0.0;
    for (std::size_t m = 0; m < count; ++m) {
      if (m == j) continue;
      double product = 1.0 / (nodes[j].time_s - nodes[m].time_s);
      for (std::size_t k = 0; k < count; ++k) {
        if (k != j && k != m) product *= (t - nodes[k].time_s) / (nodes[j].time_s - nodes[k].time_s);
      }
      slope += product;
    }
    velocity += slope * nodes[j].T_local_camera.translation;
  }
  return velocity;
}

/// The six numbers of imu_bias.csv at a time: interpolated linearly, constant beyond the rows; zeros without rows.
std::array<double, 6> biases_at(const dataset::NumberTable& biases, double time_s) {
  std::array<double, 6> values{};
  const auto& rows = biases.rows;
  if (rows.empty()) return values;
  const auto after = std::lower_bound(rows.begin(), rows.end(), time_s,
                                      [](const std::vector<double>& row, double t) { return row[0] < t; });
  const auto& high = after == rows.end() ? rows.back() : *after;
  const auto& low = after == rows.begin() ? high : *(after - 1);
  const double gap_s = high[0] - low[0];
  const double share = gap_s > 0.0 ? std::clamp((time_s - low[0]) / gap_s, 0.0, 1.0) : 0.0;
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = low[i + 1] + share * (high[i + 1] - low[i + 1]);
  return values;
}

dataset::NumberTable biases_of(const dataset::Dataset& dataset) {
  const fs::path file = dataset.folder / "imu_bias.csv";
  dataset::NumberTable biases = dataset::read_number_table(file);
  if (biases.columns.size() != 7)
    throw InputError(file.string(), "must have 7 columns: time, gyroscope, accelerometer");
  return biases;
}

/// Writes poses and velocities of the body, which is the IMU, and its biases if known.
void write_truth(const dataset::RigCamera& camera, const fs::path& folder) {
  const dataset::Dataset& dataset = camera.dataset;
  fs::create_directories(folder);
  const bool has_biases = fs::is_regular_file(dataset.folder / "imu_bias.csv");
  const dataset::NumberTable biases = has_biases ? biases_of(dataset) : dataset::NumberTable();
  std::string text =
      "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z [],"
      "v_RS_R_x [m s^-1],v_RS_R_y [m s^-1],v_RS_R_z [m s^-1]";
  if (has_biases)
    text +=
        ",b_w_RS_S_x [rad s^-1],b_w_RS_S_y [rad s^-1],b_w_RS_S_z [rad s^-1],"
        "b_a_RS_S_x [m s^-2],b_a_RS_S_y [m s^-2],b_a_RS_S_z [m s^-2]";
  text += '\n';
  const std::vector<geometry::StampedPose> poses = body_poses(camera);
  const auto add = [&text](const auto& numbers) {
    for (const double number : numbers) {
      text += ',';
      base::append_number(text, number);
    }
  };
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const geometry::Vec3& p = poses[i].T_local_camera.translation;
    const Eigen::Quaterniond& q = poses[i].T_local_camera.rotation;
    text += std::to_string(geometry::to_nanoseconds(poses[i].time_s));
    add(std::array{p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()});
    add(velocity_at(poses, i));
    if (has_biases) add(biases_at(biases, poses[i].time_s));
    text += '\n';
  }
  base::write_file(folder / "data.csv", text);
}

}  // namespace

void write_euroc(const dataset::Rig& rig, const fs::path& folder, std::vector<std::string>& notes,
                 const Progress& progress) {
  const fs::path mav = folder / "mav0";
  const dataset::RigCamera& first = rig.cameras.front();
  const auto folder_of = [&](std::size_t c) { return mav / ("cam" + std::to_string(c)); };
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) write_camera(rig.cameras[c], folder_of(c));
  if (!first.dataset.imu.empty()) write_imu(first.dataset, mav / "imu0", notes);
  if (first.dataset.groundtruth) write_truth(first, mav / "state_groundtruth_estimate0");
  for (std::size_t c = 0; c < rig.cameras.size(); ++c) {
    const dataset::RigCamera& camera = rig.cameras[c];
    if (camera.dataset.calibration.line_delay_s != 0.0 && c == 0)
      notes.push_back("sensor.yaml cannot store the rolling shutter; it is left out");
    if (camera.timeshift_s != 0.0)
      notes.push_back("times of cam" + std::to_string(c) + " are on the clock of the IMU, as EuRoC's are");
    write_png_frames(
        camera.dataset, folder_of(c) / "data", [&](std::size_t i) { return stamp_of(camera, i); }, progress);
  }
}

}  // namespace tileflight::exports
