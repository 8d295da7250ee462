#include "tileflight/capture/recording/flight_cameras.h"

#include <cmath>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/missions/mission.h"
#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/core/imaging/calibration_files.h"
#include "tileflight/data/dataset/rig.h"

namespace tileflight::recording {
namespace {

using base::StrictSection;
using geometry::SE3;
using geometry::Vec3;

/// Reads a pose in Kalibr's convention: 16 numbers, row by row.
std::optional<SE3> read_mount_matrix(StrictSection& camera) {
  const auto numbers = camera.numbers("T_body_camera", 16, 16);
  if (!numbers) return std::nullopt;
  const Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>> m(numbers->data());
  const geometry::Mat3 rotation = m.topLeftCorner<3, 3>();
  constexpr double kRounding = 1e-3;
  if (!(rotation.transpose() * rotation).isIdentity(kRounding) || rotation.determinant() < 0.0 ||
      !m.row(3).isApprox(Eigen::RowVector4d(0, 0, 0, 1), kRounding))
    throw camera.error("T_body_camera", "is not a rigid motion (rotation and translation)");
  return SE3(rotation, m.topRightCorner<3, 1>());
}

/// Reads angles, as those of a waypoint, relative to the body's direction.
SE3 read_mount(StrictSection& camera) {
  const std::optional<SE3> matrix = read_mount_matrix(camera);
  const auto position = camera.numbers("position", 3, 3);
  const auto yaw = camera.number("yaw_deg"), pitch = camera.number("pitch_deg"), roll = camera.number("roll_deg");
  const bool has_angles = yaw || pitch || roll;
  if (matrix && (position || has_angles))
    throw camera.error("T_body_camera", "and position or angles are both given; keep one of the two");
  if (matrix) return *matrix;
  SE3 T_body_camera;
  if (position) T_body_camera.translation = Vec3(position->data());
  if (has_angles)
    T_body_camera.rotation =
        (flight_path::camera_orientation(0, 0, 0).conjugate() *
         flight_path::camera_orientation(yaw.value_or(0.0), pitch.value_or(0.0), roll.value_or(0.0)))
            .normalized();
  return T_body_camera;
}

imaging::Calibration read_lens(StrictSection& camera) {
  const auto file = camera.path("camera");
  if (!file) throw camera.error("camera", "is missing; name the calibration file");
  const auto id = camera.text("camera_id");
  imaging::Calibration calibration = id ? imaging::read_calibration(*file, *id) : imaging::read_calibration(*file);
  if (const auto sides = camera.numbers("resolution", 2, 2)) {
    constexpr double kLeast = 16.0, kMost = 65536.0;
    for (const double side : *sides) {
      if (side != std::floor(side) || side < kLeast || side > kMost)
        throw camera.error("resolution", "must be width and height, 16 to 65536 pixels");
    }
    calibration.camera = calibration.camera.scaled_to(static_cast<int>(sides->at(0)), static_cast<int>(sides->at(1)));
  }
  return calibration;
}

MountedCamera read_camera(StrictSection camera, const std::optional<render::ImageFormation>& degrade) {
  constexpr double kLargestOffset_s = 10.0;
  MountedCamera mounted;
  mounted.name = camera.text("name").value_or("");
  if (mounted.name.empty()) throw camera.error("name", "is required: it is that of the camera's folder");
  if (const auto fault = dataset::fault_of_camera_names({mounted.name})) throw camera.error("name", *fault);
  mounted.calibration = read_lens(camera);
  mounted.T_body_camera = read_mount(camera);
  mounted.fps = camera.positive_number("fps");
  mounted.offset_s = camera.number("offset_s", 0.0, -kLargestOffset_s, kLargestOffset_s);
  if (auto own = camera.section("degrade"))
    mounted.degrade = render::read_image_formation(*own, degrade.value_or(render::ImageFormation{}));
  mounted.events = events::read_event_options(camera);
  camera.require_all_keys_used();
  return mounted;
}

std::vector<MountedCamera> read_list(StrictSection& flight, const std::optional<render::ImageFormation>& degrade) {
  std::vector<MountedCamera> cameras;
  for (const StrictSection& camera : flight.sections("cameras")) cameras.push_back(read_camera(camera, degrade));
  if (cameras.empty()) throw flight.error("cameras", "lists no camera; give at least one");
  return cameras;
}

std::vector<MountedCamera> read_chain(const std::filesystem::path& file) {
  std::vector<MountedCamera> cameras;
  for (imaging::ChainCamera& camera : imaging::read_camchain(file)) {
    cameras.push_back(
        {camera.name, std::move(camera.calibration), camera.T_body_cam, {}, 0.0, camera.timeshift_cam_imu_s, {}});
  }
  return cameras;
}

/// Throws InputError (file, cause).
void require_usable_names(const std::filesystem::path& file, const std::vector<MountedCamera>& cameras) {
  std::vector<std::string> names;
  for (const MountedCamera& camera : cameras) names.push_back(camera.name);
  if (const auto fault = dataset::fault_of_camera_names(names)) throw InputError(file.string(), *fault);
}

/// Sets one inertial unit for all cameras, mounted as the first camera's calibration says.
void place_imu(std::vector<MountedCamera>& cameras) {
  const SE3 T_body_imu = cameras.front().T_body_camera * cameras.front().calibration.T_cam_imu;
  for (std::size_t i = 1; i < cameras.size(); ++i)
    cameras[i].calibration.T_cam_imu = cameras[i].T_body_camera.inverse() * T_body_imu;
  for (MountedCamera& camera : cameras)
    camera.calibration.assumes_T_cam_imu = cameras.front().calibration.assumes_T_cam_imu;
}

/// Checks a rig's cameras, which were read from `file`, and gives them the rig's one IMU.
std::vector<MountedCamera> placed(const std::filesystem::path& file, std::vector<MountedCamera> cameras) {
  require_usable_names(file, cameras);
  place_imu(cameras);
  return cameras;
}

std::vector<MountedCamera> read_rig_chain(const std::filesystem::path& file) { return placed(file, read_chain(file)); }

}  // namespace

std::vector<MountedCamera> read_rig_cameras(const std::filesystem::path& file) {
  StrictSection root = StrictSection::load(file);
  if (!root.has("cameras")) return read_rig_chain(file);
  return root.is_list("cameras") ? placed(file, read_list(root, std::nullopt))
                                 : read_rig_chain(root.path("cameras").value_or(""));
}

namespace {

/// The camera of a mission that is flown without a FLIGHT file: that for which it was planned, else a usual one.
MountedCamera mission_camera(const std::filesystem::path& mission_file) {
  constexpr int kWidth = 1280, kHeight = 720;
  constexpr double kFov_deg = 70.0;
  const auto planned = missions::read_mission(mission_file).camera;
  MountedCamera mounted;
  if (planned) {
    mounted.calibration.camera = imaging::make_pinhole(planned->width, planned->height, planned->fov_deg);
    mounted.calibration.notes = {
        base::formatted("the camera is the one that the survey was planned for: %d x %d pixels, %.1f degrees across, "
                        "without distortion",
                        planned->width, planned->height, planned->fov_deg)};
  } else {
    mounted.calibration.camera = imaging::make_pinhole(kWidth, kHeight, kFov_deg);
    mounted.calibration.notes = {base::formatted(
        "the mission names no camera: one of %d x %d pixels and %g degrees across is used (a flight file "
        "with camera and mission_file names yours)",
        kWidth, kHeight, kFov_deg)};
  }
  return mounted;
}

std::vector<MountedCamera> read_own_cameras(const RenderedFlightConfig& flight) {
  StrictSection file = StrictSection::load(flight.flight);
  std::vector<MountedCamera> cameras;
  const bool is_list = file.is_list("cameras");
  if (is_list || file.path("cameras")) {
    if (!flight.camera.empty())
      throw file.error("cameras", "are a rig's; a calibration can replace that of a flight with one 'camera' only");
    cameras = is_list ? placed(flight.flight, read_list(file, flight.degrade)) : read_rig_chain(*file.path("cameras"));
    if (file.has("events"))
      throw file.error("events", "of a rig stands in the entry of its camera; write 'cameras' as a list");
  } else {
    const auto camera = file.path("camera");
    cameras.resize(1);
    cameras.front().calibration =
        imaging::read_calibration(flight.camera.empty() ? camera.value_or("") : flight.camera);
    cameras.front().events = events::read_event_options(file);
  }
  return cameras;
}

std::vector<MountedCamera> read_mission_camera(const RenderedFlightConfig& flight) {
  std::vector<MountedCamera> cameras(1);
  if (flight.camera.empty()) return {mission_camera(flight.flight)};
  cameras.front().calibration = imaging::read_calibration(flight.camera);
  return cameras;
}

}  // namespace

std::vector<MountedCamera> read_flight_cameras(const RenderedFlightConfig& flight) {
  std::vector<MountedCamera> cameras =
      missions::is_mission_file(flight.flight) ? read_mission_camera(flight) : read_own_cameras(flight);
  // The simulated unit is mounted as the calibration says, the identity included.
  for (MountedCamera& camera : cameras) camera.calibration.assumes_T_cam_imu = false;
  if (flight.width) {
    for (MountedCamera& camera : cameras)
      camera.calibration.camera = camera.calibration.camera.scaled_to(*flight.width, *flight.height);
  }
  return cameras;
}

}  // namespace tileflight::recording
