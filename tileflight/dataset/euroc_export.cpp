// EuRoC's ASL layout (Burri et al., IJRR 2016): the layout that euroc_layout.cpp reads.
#include <cmath>
#include <variant>

#include "tileflight/dataset/exports.h"
#include "tileflight/dataset/imu_files.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/text_fields.h"

namespace tileflight::dataset::exports {

namespace {

namespace fs = std::filesystem;

std::int64_t nanoseconds(double time_s) { return std::llround(1e9 * time_s); }

struct Lens {
  std::string distortion;
  std::array<double, 4> focal, coefficients;
};

Lens lens_of(const Dataset& dataset) {
  const imaging::CameraModel& model = dataset.calibration.camera.model();
  if (const auto* m = std::get_if<imaging::PinholeRadtan>(&model))
    return {"radial-tangential", {m->fx, m->fy, m->cx, m->cy}, m->d};
  if (const auto* m = std::get_if<imaging::KannalaBrandt>(&model))
    return {"equidistant", {m->fx, m->fy, m->cx, m->cy}, m->k};
  throw InputError(dataset.folder.string(),
                   "EuRoC's sensor.yaml has no name for this lens; use a radtan or an equidistant camera");
}

template <class Numbers>
std::string list_text(const Numbers& numbers) {
  std::string text = "[";
  for (const double number : numbers) {
    if (text.size() > 1) text += ", ";
    geometry::append_number(text, number);
  }
  return text + "]";
}

/// `T_BS`: sensor to body, which is the IMU.
std::string head_text(const std::string& kind, const geometry::SE3& T_BS) {
  const geometry::Mat4 m = T_BS.matrix();
  const Eigen::Matrix<double, 4, 4, Eigen::RowMajor> rows = m;
  return "%YAML:1.0\nsensor_type: " + kind + "\ncomment: simulated or exported by tileflight\n" +
         "T_BS:\n  cols: 4\n  rows: 4\n  data: " + list_text(std::span<const double>(rows.data(), 16)) + "\n";
}

std::string rate_text(double rate_hz) {
  std::string text = "rate_hz: ";
  geometry::append_number(text, rate_hz);
  return text + "\n";
}

double frame_rate_hz(const Dataset& dataset) {
  if (dataset.frames.size() < 2) return 1.0;
  const double span_s = dataset.frames.back().time_s - dataset.frames.front().time_s;
  return std::round(1e6 * static_cast<double>(dataset.frames.size() - 1) / span_s) / 1e6;
}

void write_camera(const Dataset& dataset, const fs::path& folder) {
  const Lens lens = lens_of(dataset);
  const imaging::Camera& camera = dataset.calibration.camera;
  fs::create_directories(folder);
  geometry::write_file(
      folder / "sensor.yaml",
      head_text("camera", dataset.calibration.T_cam_imu.inverse()) + rate_text(frame_rate_hz(dataset)) +
          "resolution: [" + std::to_string(camera.width()) + ", " + std::to_string(camera.height()) +
          "]\ncamera_model: pinhole\nintrinsics: " + list_text(lens.focal) + "\ndistortion_model: " + lens.distortion +
          "\ndistortion_coefficients: " + list_text(lens.coefficients) + "\n");
  std::string list = "#timestamp [ns],filename\n";
  for (const Frame& frame : dataset.frames) {
    const std::string name = std::to_string(nanoseconds(frame.time_s));
    list += name + "," + name + ".png\n";
  }
  geometry::write_file(folder / "data.csv", list);
}

void write_imu(const Dataset& dataset, const fs::path& folder) {
  fs::create_directories(folder);
  const ImuCalibration imu = read_imu_yaml(dataset.folder / "imu.yaml");
  std::string text = head_text("imu", {}) + rate_text(imu.update_rate_hz);
  const auto line = [&text](const char* key, double value) {
    text += key;
    geometry::append_number(text, value);
    text += '\n';
  };
  line("gyroscope_noise_density: ", imu.gyroscope_noise_density);
  line("gyroscope_random_walk: ", imu.gyroscope_random_walk);
  line("accelerometer_noise_density: ", imu.accelerometer_noise_density);
  line("accelerometer_random_walk: ", imu.accelerometer_random_walk);
  geometry::write_file(folder / "sensor.yaml", text);
  write_imu_csv(folder / "data.csv", read_imu_csv(dataset.folder / "imu.csv"));
}

/// Poses of the body; EuRoC's further columns (velocity, biases) are not known here.
void write_truth(const Dataset& dataset, const fs::path& folder) {
  fs::create_directories(folder);
  std::string text = "#timestamp,p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],q_RS_y [],q_RS_z []\n";
  for (const geometry::StampedPose& pose : dataset.groundtruth->poses) {
    const geometry::SE3 T_local_body = pose.T_local_camera * dataset.calibration.T_cam_imu;
    const geometry::Vec3& p = T_local_body.translation;
    const Eigen::Quaterniond& q = T_local_body.rotation;
    text += std::to_string(nanoseconds(pose.time_s));
    for (const double number : {p.x(), p.y(), p.z(), q.w(), q.x(), q.y(), q.z()}) {
      text += ',';
      geometry::append_number(text, number);
    }
    text += '\n';
  }
  geometry::write_file(folder / "data.csv", text);
}

}  // namespace

void write_euroc(const Dataset& dataset, const fs::path& folder, std::vector<std::string>& notes,
                 const Progress& progress) {
  const fs::path mav = folder / "mav0";
  write_camera(dataset, mav / "cam0");
  if (fs::is_regular_file(dataset.folder / "imu.csv")) write_imu(dataset, mav / "imu0");
  if (dataset.groundtruth) write_truth(dataset, mav / "state_groundtruth_estimate0");
  if (dataset.calibration.line_delay_s != 0.0) notes.push_back("sensor.yaml has no place for the rolling shutter");
  write_png_frames(
      dataset, mav / "cam0" / "data",
      [&](std::size_t i) { return std::to_string(nanoseconds(dataset.frames[i].time_s)); }, progress);
}

}  // namespace tileflight::dataset::exports
