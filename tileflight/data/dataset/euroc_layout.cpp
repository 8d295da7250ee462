// EuRoC's ASL layout (Burri et al., IJRR 2016): cam0/data.csv "time_ns,file", cam0/data/, cam0/sensor.yaml.

#include <cmath>
#include <cstdint>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/geometry/nanoseconds.h"
#include "tileflight/core/geometry/trajectory.h"
#include "tileflight/core/imaging/calibration_checks.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/layouts.h"

namespace tileflight::dataset::layouts {

namespace {

namespace fs = std::filesystem;

fs::path camera_folder(const fs::path& folder, const std::string& name = "cam0") {
  for (const fs::path& sensors : {folder / "mav0", folder})
    if (fs::is_regular_file(sensors / name / "data.csv") ||
        (fs::is_regular_file(sensors / name / "sensor.yaml") && fs::is_directory(sensors / name / "data")))
      return sensors / name;
  return {};
}

/// The frames of a camera without data.csv: EuRoC names its images by their time in nanoseconds.
std::vector<Frame> frames_by_name(const fs::path& camera, std::vector<std::string>& warnings) {
  std::vector<Frame> frames;
  for (const fs::path& image : list_images(camera / "data")) {
    const std::string name = image.stem().string();
    const auto time_ns = base::parse_number<std::int64_t>(name);
    if (!time_ns)
      throw InputError(image.string(),
                       "its name is not a time in nanoseconds, and there is no data.csv that states one");
    frames.push_back({name, image, geometry::to_seconds(*time_ns), 0.0});
  }
  warnings.push_back(camera.string() + ": no data.csv; the times are the names of the images, in nanoseconds");
  require_increasing_times(frames, camera / "data");
  return frames;
}

std::vector<Frame> read_frames(const fs::path& camera, std::vector<std::string>& warnings) {
  const fs::path file = camera / "data.csv";
  if (!fs::is_regular_file(file)) return frames_by_name(camera, warnings);
  std::vector<Frame> frames;
  base::for_each_row(base::read_text(file), file.string(), ", \t", [&](const base::TextRow& row) {
    const auto time_ns = base::parse_number<std::int64_t>(row.fields.front());
    if (!time_ns || row.fields.size() != 2) throw InputError(row.where, "expected \"time_in_nanoseconds,file\"");
    const fs::path image = camera / "data" / fs::path(row.fields[1]).filename();
    frames.push_back({image.stem().string(), image, geometry::to_seconds(*time_ns), 0.0});
  });
  return existing_frames(std::move(frames), file, warnings);
}

/// Reads the chosen camera. If its file has no IMU extrinsics, the layout's T_BS is used if present.
imaging::Calibration read_chosen_calibration(const CameraChoice& camera, const fs::path& sensor_file,
                                             Dataset& dataset) {
  imaging::Calibration calibration = read_chosen_camera(camera, dataset);
  const bool says_nothing = calibration.T_cam_imu.matrix().isIdentity(0.0);
  if (says_nothing && fs::is_regular_file(sensor_file)) {
    const imaging::Calibration own = imaging::read_euroc_sensor(sensor_file);
    calibration.T_cam_imu = own.T_cam_imu;
    calibration.assumes_T_cam_imu = own.assumes_T_cam_imu && calibration.assumes_T_cam_imu;
  }
  return calibration;
}

/// The camera's poses from state_groundtruth_estimate0/data.csv beside its folder, which holds those of the body: the
/// IMU.
std::optional<geometry::Trajectory> read_truth(const fs::path& file, const geometry::SE3& T_cam_imu) {
  if (!fs::is_regular_file(file)) return std::nullopt;
  geometry::Trajectory trajectory = geometry::read_euroc_poses(file);
  for (geometry::StampedPose& pose : trajectory.poses) pose.T_local_camera = pose.T_local_camera * T_cam_imu.inverse();
  return trajectory;
}

}  // namespace

bool is_euroc(const fs::path& folder) { return !camera_folder(folder).empty(); }

std::vector<std::string> euroc_cameras(const fs::path& folder) {
  std::vector<std::string> names;
  for (std::string name = "cam0"; !camera_folder(folder, name).empty(); name = "cam" + std::to_string(names.size()))
    names.push_back(name);
  return names.size() > 1 ? names : std::vector<std::string>{};
}

Dataset read_euroc(const fs::path& folder, const CameraChoice& camera_choice) {
  Dataset dataset;
  dataset.folder = folder;
  const fs::path camera = camera_folder(folder, camera_choice.name.empty() ? "cam0" : camera_choice.name);
  dataset.frames = read_frames(camera, dataset.warnings);
  dataset.calibration = camera_choice.calibration.empty()
                            ? imaging::read_euroc_sensor(camera / "sensor.yaml")
                            : read_chosen_calibration(camera_choice, camera / "sensor.yaml", dataset);
  const fs::path sensors = camera.parent_path();
  for (const char* truth : {"state_groundtruth_estimate0", "mocap0"}) {  // the latter: TUM VI
    dataset.groundtruth = read_truth(sensors / truth / "data.csv", dataset.calibration.T_cam_imu);
    if (dataset.groundtruth) break;
  }
  if (const fs::path file = sensors / "imu0" / "data.csv"; fs::is_regular_file(file)) dataset.imu = file;
  if (const fs::path file = sensors / "imu0" / "sensor.yaml"; fs::is_regular_file(file)) dataset.imu_noise = file;
  return dataset;
}

}  // namespace tileflight::dataset::layouts
