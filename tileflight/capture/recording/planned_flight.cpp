#include "tileflight/capture/recording/planned_flight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tileflight/capture/flight_path/path.h"
#include "tileflight/capture/recording/flight_cameras.h"
#include "tileflight/capture/recording/flown_path.h"
#include "tileflight/capture/vehicle/flight_plan.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/random_numbers.h"

namespace tileflight::recording {
namespace {

constexpr double kMostImages = 1e7;

/// Returns the poses of an event camera on its way to the next frame and there.
void append_way_to_next(const PlannedCamera& camera, std::size_t frame, std::vector<geometry::SE3>& poses) {
  constexpr int kPoses = 4;
  if (!camera.events) return;
  const std::vector<geometry::StampedPose>& frames = camera.frames.poses;
  const double from_s = frames[frame].time_s, to_s = frames[std::min(frame + 1, frames.size() - 1)].time_s;
  for (int k = 1; k <= kPoses; ++k) poses.push_back(camera.pose_at(from_s + (to_s - from_s) * k / kPoses));
}

/// Poses of the camera at a frame, and if its shutter is open for some time, before and after it.
std::vector<geometry::SE3> exposure_poses(const PlannedCamera& camera, std::size_t frame) {
  const render::ImageFormation& formation = camera.options.formation;
  const double open_s = formation.exposure_time_s * render::max_exposure_gain(formation) +
                        std::abs(formation.line_delay_s) * camera.calibration.camera.height();
  const geometry::StampedPose& pose = camera.frames.poses[frame];
  std::vector<geometry::SE3> poses{pose.T_local_camera};
  append_way_to_next(camera, frame, poses);
  if (open_s == 0.0) return poses;
  for (const double time_s : {pose.time_s - open_s, pose.time_s + open_s}) poses.push_back(camera.pose_at(time_s));
  return poses;
}

/// Multiplies two poses; if one is the identity, the result is exactly the other.
geometry::SE3 composed(const geometry::SE3& T_a_b, const geometry::SE3& T_b_c) {
  if (T_b_c.matrix().isIdentity(0.0)) return T_a_b;
  return T_a_b.matrix().isIdentity(0.0) ? T_b_c : T_a_b * T_b_c;
}

/// Returns the body's poses at the moments of a camera's exposures, on the flight's clock: at the flight's instants, or
/// at the camera's own rate from the first to the last of them. They are later by the camera's offset, as far as the
/// path goes.
geometry::Trajectory exposure_instants(const MountedCamera& camera, const flight_path::Path& path,
                                       const geometry::Trajectory& body) {
  constexpr double kRounding_s = 1e-9;
  if (!camera.fps && camera.offset_s == 0.0) return body;
  std::vector<double> times_s;
  const double start_s = body.poses.front().time_s, end_s = body.poses.back().time_s + kRounding_s;
  for (std::size_t i = 0; camera.fps && start_s + static_cast<double>(i) / *camera.fps <= end_s; ++i)
    times_s.push_back(start_s + static_cast<double>(i) / *camera.fps);
  for (std::size_t i = 0; !camera.fps && i < body.size(); ++i) times_s.push_back(body.poses[i].time_s);
  geometry::Trajectory instants;
  for (const double time_s : times_s) {
    const double exposed_s = time_s + camera.offset_s;
    if (exposed_s >= path.start_s() - kRounding_s && exposed_s <= path.end_s() + kRounding_s)
      instants.poses.push_back({exposed_s, path.pose(exposed_s)});
  }
  if (instants.empty()) throw InputError("camera " + camera.name, "takes no image during the flight");
  return instants;
}

/// Gives the cameras of a rig noise of their own.
std::uint64_t noise_seed(std::uint64_t seed, std::size_t camera) {
  return camera == 0 ? seed : base::stream_key(seed, camera);
}

PlannedCamera plan_camera(const MountedCamera& mount, std::size_t number, const flight_path::Path& path,
                          const geometry::Trajectory& body, const RenderSettings& settings) {
  const RenderedFlightConfig& flight = settings.flight;
  PlannedCamera camera{.name = mount.name,
                       .calibration = mount.calibration,
                       .T_body_camera = mount.T_body_camera,
                       .timeshift_s = mount.timeshift_s,
                       .frames = exposure_instants(mount, path, body),
                       .pose_at = {},
                       .options = {},
                       .events = {}};
  for (geometry::StampedPose& pose : camera.frames.poses) {
    pose.T_local_camera = composed(pose.T_local_camera, camera.T_body_camera);
    pose.time_s -= camera.timeshift_s;
  }
  camera.pose_at = [path, T_body_camera = camera.T_body_camera, shift_s = camera.timeshift_s](double time_s) {
    return composed(path.pose(time_s + shift_s), T_body_camera);
  };
  camera.options.render = {.depth = flight.outputs.depth, .samples_per_pixel = flight.samples_per_pixel};
  camera.options.outputs = flight.outputs.to_frame_outputs();
  if (flight.degrade) camera.options.formation = *flight.degrade;
  if (mount.degrade) camera.options.formation = *mount.degrade;
  camera.options.formation.seed = noise_seed(settings.seed, number);
  camera.calibration.line_delay_s = camera.options.formation.line_delay_s;
  camera.events = mount.events;
  if (camera.events) camera.events->seed = camera.options.formation.seed;
  return camera;
}

/// Throws InputError for more than kMostImages images, before any of them is planned.
void require_few_images(const std::vector<MountedCamera>& cameras, const geometry::Trajectory& body) {
  const double span_s = body.poses.back().time_s - body.poses.front().time_s;
  double images = 0.0;
  for (const MountedCamera& camera : cameras)
    images += camera.fps ? span_s * *camera.fps + 1.0 : static_cast<double>(body.size());
  if (images > kMostImages)
    throw InputError("flight", "its cameras take more than ten million images; lower 'fps' or set 'max_frames'");
}

/// The flight file's weather, the same for all cameras; null if it names none.
std::shared_ptr<const render::WeatherOptions> read_seeded_weather(const RenderSettings& settings) {
  if (missions::is_mission_file(settings.flight.flight)) return nullptr;
  auto weather = render::read_weather(settings.flight.flight);
  if (!weather) return nullptr;
  weather->seed = settings.seed;
  return std::make_shared<const render::WeatherOptions>(*weather);
}

/// Shows cars and people to all cameras, each by its own clock.
void show_traffic(PlannedFlight& mission) {
  const auto placed_at = [&mission](double shift_s) {
    return [traffic = mission.traffic, shift_s](double from_s, double to_s) {
      return traffic->placed(from_s + shift_s, to_s + shift_s);
    };
  };
  for (std::size_t i = 0; i < mission.camera_count(); ++i) {
    render::FlightRenderOptions& options = mission.camera(i).options;
    options.placed = placed_at(mission.camera(i).timeshift_s);
    options.outputs.placed_objects = true;  // for the boxes of what is visible
  }
  mission.sensor_recorder->set_placed(placed_at(0.0));
}

}  // namespace

ImageOrder::ImageOrder(const PlannedFlight& mission) : numbers_(mission.camera_count()) {
  for (std::size_t camera = 0; camera < mission.camera_count(); ++camera) {
    numbers_[camera].resize(mission.camera(camera).frames.size());
    for (std::size_t frame = 0; frame < numbers_[camera].size(); ++frame) images_.push_back({camera, frame});
  }
  std::ranges::stable_sort(images_, {}, [&](const ImageId& image) {
    const PlannedCamera& camera = mission.camera(image.camera);
    return camera.frames.poses[image.frame].time_s + camera.timeshift_s;
  });
  for (std::size_t i = 0; i < images_.size(); ++i) numbers_[images_[i].camera][images_[i].frame] = i;
}

jobs::IndexRange ImageOrder::frames_between(std::size_t camera, std::size_t begin, std::size_t end) const {
  const std::vector<std::size_t>& numbers = numbers_[camera];
  const auto first_from = [&](std::size_t image) {
    return static_cast<std::size_t>(std::ranges::lower_bound(numbers, image) - numbers.begin());
  };
  return {first_from(begin), first_from(end)};
}

std::size_t PlannedFlight::image_count() const {
  std::size_t images = 0;
  for (std::size_t i = 0; i < camera_count(); ++i) images += camera(i).frames.size();
  return images;
}

bool PlannedFlight::has_events() const {
  for (std::size_t i = 0; i < camera_count(); ++i) {
    if (camera(i).events) return true;
  }
  return false;
}

PlannedFlight plan_flight(const RenderSettings& settings, const Progress& progress) {
  const RenderedFlightConfig& flight = settings.flight;
  const bool is_mission = missions::is_mission_file(flight.flight);
  vehicle::FlightPlan plan = vehicle::read_flight_plan(flight.flight);
  place_mission(plan, settings.source, settings.load, progress);
  const std::vector<MountedCamera> cameras = read_flight_cameras(flight);
  PlannedFlight mission;
  const MountedCamera& first = cameras.front();
  mission.notes = plan.notes;
  if (is_mission)
    mission.notes.insert(mission.notes.end(), first.calibration.notes.begin(), first.calibration.notes.end());
  FlownPath flown = fly_plan(plan, settings, first.calibration.camera, progress);
  mission.body = std::move(flown.frames);
  mission.vehicle = std::move(flown.vehicle);
  if (flight.max_frames && mission.body.size() > static_cast<std::size_t>(*flight.max_frames)) {
    mission.body.poses.resize(static_cast<std::size_t>(*flight.max_frames));
  }
  require_few_images(cameras, mission.body);
  static_cast<PlannedCamera&>(mission) = plan_camera(first, 0, flown.path, mission.body, settings);
  for (std::size_t i = 1; i < cameras.size(); ++i)
    mission.others.push_back(plan_camera(cameras[i], i, flown.path, mission.body, settings));
  const geometry::SE3 T_body_imu = composed(first.T_body_camera, first.calibration.T_cam_imu);
  const sensors::SensorSuite suite =
      is_mission ? sensors::SensorSuite{} : sensors::read_sensor_suite(flight.flight, settings.seed, T_body_imu);
  mission.sensor_recorder = std::make_shared<SensorRecorder>(suite, flown.path, mission.body);
  std::vector<geometry::SE3> flown_poses;
  for (const geometry::StampedPose& pose : mission.frames.poses) flown_poses.push_back(pose.T_local_camera);
  mission.traffic =
      flown.traffic ? flown.traffic : plan_traffic(settings, mission.calibration.camera, flown_poses, progress);
  if (const auto weather = read_seeded_weather(settings)) {
    for (std::size_t i = 0; i < mission.camera_count(); ++i) {
      PlannedCamera& camera = mission.camera(i);
      camera.options.render.weather = weather;
      camera.options.render.weather_offset_s = camera.timeshift_s;  // drops fall by the flight's clock
    }
  }
  if (mission.traffic) show_traffic(mission);
  return mission;
}

namespace {

/// Whether images or other sensors depend on tiles outside the cameras' views: on those that cast shadows into them, or
/// that a lidar, a range finder or an event camera needs.
bool needs_all_directions(const PlannedFlight& mission) {
  for (std::size_t i = 0; i < mission.camera_count(); ++i) {
    if (mission.camera(i).options.formation.light) return true;
  }
  return mission.has_events() || mission.sensor_recorder->suite().needs_scene();
}

}  // namespace

std::vector<tileset::ViewCone> flight_view_cones(const PlannedFlight& mission, std::size_t camera) {
  const PlannedCamera& seen_by = mission.camera(camera);
  std::vector<geometry::SE3> poses;
  for (std::size_t frame = 0; frame < seen_by.frames.size(); ++frame) {
    const std::vector<geometry::SE3> of_frame = exposure_poses(seen_by, frame);
    poses.insert(poses.end(), of_frame.begin(), of_frame.end());
  }
  std::vector<tileset::ViewCone> cones = tileset::view_cones_along(seen_by.calibration.camera, poses);
  return needs_all_directions(mission) ? tileset::widen_to_all_directions(std::move(cones)) : cones;
}

geometry::Vec3 body_position(const PlannedCamera& camera, std::size_t frame) {
  return camera.frames.poses[frame].T_local_camera * camera.T_body_camera.inverse().translation;
}

FrameGroups group_images(const std::vector<geometry::Vec3>& body_positions, const PlannedFlight& mission,
                         const RenderSettings& settings) {
  FrameGroups groups = settings.error_px ? group_frames(body_positions) : single_group(body_positions);
  // Independent of the cameras, so that each takes the same images beside others as alone.
  if (groups.count() == 1 && !mission.body.empty())
    groups.anchors.front() = mission.body.poses[mission.body.size() / 2].T_local_camera.translation;
  return groups;
}

FrameGroups group_flight_frames(const PlannedFlight& mission, const RenderSettings& settings) {
  std::vector<geometry::Vec3> positions;
  for (std::size_t i = 0; i < mission.frames.size(); ++i) positions.push_back(body_position(mission, i));
  return group_images(positions, mission, settings);
}

}  // namespace tileflight::recording
