#include "tileflight/live/publishing/live_view.h"

#include <algorithm>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/messages/dataset_messages.h"
#include "tileflight/live/publishing/place_glb.h"
#include "tileflight/live/publishing/viewer_channels.h"
#include "tileflight/live/simulator/airsim_types.h"
#include "tileflight/live/simulator/viewer.h"

namespace tileflight::publishing {
namespace {

std::string frame_of(const std::string& vehicle, const std::string& part);
std::string body_frame(const std::string& vehicle);
std::string odometry_frame(const std::string& vehicle);
std::string camera_frame(const std::string& vehicle, const std::string& camera);
messages::ros::Header header(std::uint64_t time_ns, const std::string& frame);

imaging::RgbImage rgb_of(const simulator::ImageResponse& image);
std::string jpeg_of(const imaging::RgbImage& rgb, int quality);
/// Infinite where there is no surface.
imaging::FloatImage depth_of(const simulator::ImageResponse& image);
std::vector<dataset::ScanPoint> points_of(const simulator::ObservedScan& scan);
/// The sensors on their vehicles, and where odometry begins.
std::vector<messages::ros::FrameTransform> static_transforms_of(const simulator::Observation& now);

bool is_same(const messages::ros::FrameTransform& a, const messages::ros::FrameTransform& b);
/// Whether time and all poses are the same: clients may also place vehicles while time stands still.
bool is_same(const simulator::Observation& a, const simulator::Observation& b);

/// AirSim's depth where there is no surface.
constexpr float kNoSurface_m = 65504.0F;

bool is_same(const geometry::SE3& a, const geometry::SE3& b) {
  return a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

using messages::kMapFrame;
using messages::ros::Header;

std::string frame_of(const std::string& vehicle, const std::string& part) { return vehicle + "/" + part; }
std::string body_frame(const std::string& vehicle) { return frame_of(vehicle, "base_link"); }
std::string odometry_frame(const std::string& vehicle) { return frame_of(vehicle, "odom"); }
std::string camera_frame(const std::string& vehicle, const std::string& camera) {
  return frame_of(vehicle, camera + "_optical");
}

Header header(std::uint64_t time_ns, const std::string& frame) { return {static_cast<std::int64_t>(time_ns), frame}; }

imaging::RgbImage rgb_of(const simulator::ImageResponse& image) {
  imaging::RgbImage rgb(image.width, image.height);
  for (std::size_t i = 0; i < rgb.pixels.size(); ++i) {
    const std::uint8_t* bgr = image.image_data_uint8.data() + 3 * i;
    rgb.pixels[i] = {bgr[2], bgr[1], bgr[0]};
  }
  return rgb;
}

std::string jpeg_of(const imaging::RgbImage& rgb, int quality) {
  const std::vector<std::byte> bytes = imaging::encode_jpeg(rgb, quality);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

imaging::FloatImage depth_of(const simulator::ImageResponse& image) {
  imaging::FloatImage depth_m(image.width, image.height);
  std::ranges::transform(image.image_data_float, depth_m.pixels.begin(), [](float metres) {
    return metres >= kNoSurface_m ? std::numeric_limits<float>::infinity() : metres;
  });
  return depth_m;
}

std::vector<dataset::ScanPoint> points_of(const simulator::ObservedScan& scan) {
  std::vector<dataset::ScanPoint> points(scan.points_m.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    points[i] = {scan.points_m[i], scan.intensities[i], scan.times_s[i], scan.rings[i]};
  return points;
}

std::vector<messages::ros::FrameTransform> static_transforms_of(const simulator::Observation& now) {
  std::vector<messages::ros::FrameTransform> all;
  for (const simulator::ObservedVehicle& vehicle : now.vehicles) {
    const Header on_body = header(now.time_ns, body_frame(vehicle.name));
    all.push_back({header(now.time_ns, kMapFrame), odometry_frame(vehicle.name), {}});
    for (const simulator::ObservedCamera& camera : vehicle.cameras)
      all.push_back({on_body, camera_frame(vehicle.name, camera.name), camera.T_body_camera});
    for (const simulator::ObservedLidar& lidar : vehicle.lidars)
      all.push_back({on_body, frame_of(vehicle.name, lidar.name), lidar.T_body_lidar});
    for (const std::string& imu : vehicle.imus) all.push_back({on_body, frame_of(vehicle.name, imu), {}});
  }
  return all;
}

bool is_same(const messages::ros::FrameTransform& a, const messages::ros::FrameTransform& b) {
  return a.child_frame_id == b.child_frame_id && is_same(a.T_frame_child, b.T_frame_child);
}

bool is_same(const simulator::Observation& a, const simulator::Observation& b) {
  const auto same_camera = [](const simulator::ObservedCamera& x, const simulator::ObservedCamera& y) {
    return is_same(x.T_body_camera, y.T_body_camera);
  };
  const auto same_vehicle = [&](const simulator::ObservedVehicle& x, const simulator::ObservedVehicle& y) {
    return x.name == y.name && is_same(x.T_local_body, y.T_local_body) &&
           std::ranges::equal(x.cameras, y.cameras, same_camera);
  };
  return a.time_ns == b.time_ns && std::ranges::equal(a.vehicles, b.vehicles, same_vehicle);
}

using Seconds = std::chrono::duration<double>;
using WallTime = std::chrono::steady_clock::time_point;

constexpr std::size_t kMaxPathPosesShown = 1000;  // reached within 250 m: what is kept does not grow for long
constexpr std::chrono::seconds kPathPeriod{1};
constexpr double kPathStep_m = 0.25;
constexpr std::size_t kMaxPlaceTriangles = 8'000'000;

/// Keeps every second pose once there are too many, so that a path of any length stays whole.
void add_to_path(std::vector<geometry::StampedPose>& path, const geometry::StampedPose& pose) {
  if (!path.empty()) {
    const geometry::Vec3 way = pose.T_local_camera.translation - path.back().T_local_camera.translation;
    if (way.norm() < kPathStep_m) return;
  }
  path.push_back(pose);
  if (path.size() <= kMaxPathPosesShown) return;
  for (std::size_t i = 0; 2 * i < path.size(); ++i) path[i] = path[2 * i];
  path.resize((path.size() + 1) / 2);
}

void wait(Seconds time, const std::stop_token& stop) {
  std::mutex mutex;
  std::condition_variable_any wake;
  std::unique_lock lock(mutex);
  wake.wait_for(lock, stop, time, [] { return false; });
}

}  // namespace

LiveView::LiveView(CurrentSimulator simulator, const LiveOptions& options, Log log)
    : simulator_(std::move(simulator)),
      options_(options),
      log_(std::move(log)),
      image_rate_hz_(options.image_rate_hz) {}

LiveView::~LiveView() { stop(); }

void LiveView::start(MessageSink& sink) {
  sink_ = &sink;
  tf_ = sink.add_channel(ros_channel("/tf", "tf2_msgs/msg/TFMessage"));
  tf_static_ = sink.add_channel(ros_channel("/tf_static", "tf2_msgs/msg/TFMessage", true));
  clock_ = sink.add_channel(ros_channel("/clock", "rosgraph_msgs/msg/Clock"));
  place_ = sink.add_channel(scene_channel("/place"));
  shown_ = simulator_();
  add_channels(simulator_()->viewer().observe());
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void LiveView::stop() {
  thread_ = {};
  place_thread_ = {};
}

foxglove::ParameterAccess LiveView::parameters() {
  foxglove::ParameterAccess access;
  access.read = [this] {
    return std::vector<foxglove::Parameter>{{"paused", simulator_()->clock().is_paused()},
                                            {"image_rate_hz", image_rate_hz()}};
  };
  access.write = [this](const foxglove::Parameter& wanted) { set_parameter(wanted); };
  return access;
}

void LiveView::set_parameter(const foxglove::Parameter& wanted) {
  if (wanted.name == "paused") {
    if (!options_.may_pause)
      throw InputError(
          "paused",
          "cannot be set: viewers may only watch, since clients need a token here or the session is recorded");
    const auto* value = std::get_if<bool>(&wanted.value);
    if (value == nullptr) throw InputError("paused", "must be true or false");
    return simulator_()->clock().pause(*value);
  }
  if (wanted.name != "image_rate_hz")
    throw InputError(wanted.name.substr(0, 100), "is no parameter here; there are paused and image_rate_hz");
  const auto* value = std::get_if<double>(&wanted.value);
  if (value == nullptr || !(*value >= 0.1 && *value <= kMaxImageRate_hz))
    throw InputError("image_rate_hz", "must be a number from 0.1 to 60");
  const std::lock_guard lock(mutex_);
  image_rate_hz_ = *value;
}

double LiveView::image_rate_hz() const {
  const std::lock_guard lock(mutex_);
  return image_rate_hz_;
}

/// While nothing moves, what is there is sent once to those who subscribe.
void LiveView::run(const std::stop_token& stop) {
  std::optional<simulator::Observation> last;  ///< of which pictures were sent
  std::uint64_t last_changes = 0;
  WallTime next_images{}, next_paths{};
  while (sink_->wait_for_audience(stop)) {
    const WallTime begin = std::chrono::steady_clock::now();
    const std::uint64_t changes = sink_->audience_changes();
    const bool is_other_audience = changes != std::exchange(last_changes, changes);
    follow_level();
    const simulator::Observation now = simulator_()->viewer().observe();
    const Seconds image_period(1.0 / image_rate_hz());
    if (is_other_audience || !last || !is_same(now, *last)) {
      const Due due{is_other_audience || begin >= next_images, is_other_audience || begin >= next_paths};
      if (due.images) next_images = begin + std::chrono::duration_cast<WallTime::duration>(image_period);
      if (due.paths) next_paths = begin + kPathPeriod;
      try {
        publish(now, due, stop);
      } catch (const std::exception& error) {
        report(error.what());
      }
      if (due.images && due.paths) last = now;
    }
    const Seconds period = std::min(Seconds(1.0 / options_.pose_rate_hz), image_period);
    wait(period - (std::chrono::steady_clock::now() - begin), stop);
  }
}

/// Another level has other vehicles, paths and place.
void LiveView::follow_level() {
  const std::shared_ptr<simulator::Simulator> current = simulator_();
  if (shown_.lock() == current) return;
  shown_ = current;
  for (const auto& [name, channels] : vehicles_) remove_channels(channels);
  vehicles_.clear();
  static_transforms_.clear();
  place_thread_ = {};
}

void LiveView::publish(const simulator::Observation& now, const Due& due, const std::stop_token& stop) {
  add_channels(now);
  sink_->publish_time(now.time_ns);
  if (is_wanted(clock_))
    sink_->publish(clock_, now.time_ns, messages::ros::clock(static_cast<std::int64_t>(now.time_ns)));
  publish_static_transforms(now);
  if (is_wanted(tf_)) publish_transforms(now);
  if (is_wanted(place_)) start_place();
  for (const simulator::ObservedVehicle& vehicle : now.vehicles) {
    VehicleChannels& channels = vehicles_.at(vehicle.name);
    publish_state(now.time_ns, vehicle, channels);
    if (vehicle.location && channels.location) publish_location(vehicle, channels);
    add_to_path(channels.flown, {static_cast<double>(now.time_ns) * 1e-9, vehicle.T_local_body});
    if (due.paths && is_wanted(channels.path))
      sink_->publish(channels.path, now.time_ns, messages::ros::path(header(now.time_ns, kMapFrame), channels.flown));
    for (const auto& [imu, channel] : channels.imus) publish_imu(vehicle, imu, channel);
    if (!due.images) continue;
    for (const simulator::ObservedCamera& camera : vehicle.cameras) {
      if (!stop.stop_requested()) publish_camera(vehicle, camera, channels.cameras.at(camera.name));
    }
    for (const simulator::ObservedLidar& lidar : vehicle.lidars) {
      if (!stop.stop_requested()) publish_scan(vehicle, lidar, channels.lidars.at(lidar.name));
    }
  }
}

/// Vehicles may have come since, or gone.
void LiveView::add_channels(const simulator::Observation& now) {
  std::erase_if(vehicles_, [&](const auto& known) {
    const bool is_gone =
        std::ranges::find(now.vehicles, known.first, &simulator::ObservedVehicle::name) == now.vehicles.end();
    if (is_gone) remove_channels(known.second);
    return is_gone;
  });
  for (const simulator::ObservedVehicle& vehicle : now.vehicles) {
    if (!vehicles_.contains(vehicle.name)) vehicles_.emplace(vehicle.name, channels_of(vehicle));
  }
}

LiveView::VehicleChannels LiveView::channels_of(const simulator::ObservedVehicle& vehicle) {
  const std::string root = "/" + vehicle.name;
  const auto add = [this](const std::string& topic, const std::string& type) {
    return sink_->add_channel(ros_channel(topic, type));
  };
  VehicleChannels channels;
  for (const simulator::ObservedCamera& camera : vehicle.cameras) {
    const std::string of_camera = root + "/" + camera.name;
    channels.cameras[camera.name] = {add(of_camera + "/image", "sensor_msgs/msg/Image"),
                                     add(of_camera + "/image/compressed", "sensor_msgs/msg/CompressedImage"),
                                     add(of_camera + "/camera_info", "sensor_msgs/msg/CameraInfo"),
                                     add(of_camera + "/depth", "sensor_msgs/msg/Image")};
  }
  for (const simulator::ObservedLidar& lidar : vehicle.lidars)
    channels.lidars[lidar.name] = add(root + "/" + lidar.name + "/points", "sensor_msgs/msg/PointCloud2");
  for (const std::string& imu : vehicle.imus)
    channels.imus[imu] = add(root + "/" + imu + "/data_raw", "sensor_msgs/msg/Imu");
  channels.odometry = add(root + "/odometry", "nav_msgs/msg/Odometry");
  if (vehicle.locates_itself) channels.location = add(root + "/location", "nav_msgs/msg/Odometry");
  channels.path = sink_->add_channel(ros_channel(root + "/path", "nav_msgs/msg/Path", true));
  channels.gnss = add(root + "/gnss", "sensor_msgs/msg/NavSatFix");
  channels.motion = sink_->add_channel(motion_channel(root + "/motion"));
  return channels;
}

void LiveView::remove_channels(const VehicleChannels& channels) {
  for (const auto& [name, camera] : channels.cameras) {
    for (const ChannelId one : {camera.image, camera.compressed, camera.info, camera.depth}) sink_->remove_channel(one);
  }
  for (const auto& [name, lidar] : channels.lidars) sink_->remove_channel(lidar);
  for (const auto& [name, imu] : channels.imus) sink_->remove_channel(imu);
  for (const ChannelId one : {channels.odometry, channels.path, channels.gnss, channels.motion})
    sink_->remove_channel(one);
  if (channels.location) sink_->remove_channel(*channels.location);
}

void LiveView::publish_transforms(const simulator::Observation& now) {
  std::vector<messages::ros::FrameTransform> moving;
  for (const simulator::ObservedVehicle& vehicle : now.vehicles)
    moving.push_back(
        {header(now.time_ns, odometry_frame(vehicle.name)), body_frame(vehicle.name), vehicle.T_local_body});
  sink_->publish(tf_, now.time_ns, messages::ros::transforms(moving));
}

/// Once, and when a client has placed a camera otherwise: who comes later gets the last message.
void LiveView::publish_static_transforms(const simulator::Observation& now) {
  std::vector<messages::ros::FrameTransform> all = static_transforms_of(now);
  const auto same = [](const auto& a, const auto& b) { return is_same(a, b); };
  if (std::ranges::equal(all, static_transforms_, same)) return;
  sink_->publish(tf_static_, now.time_ns, messages::ros::transforms(all));
  static_transforms_ = std::move(all);
}

void LiveView::publish_state(std::uint64_t time_ns, const simulator::ObservedVehicle& vehicle,
                             const VehicleChannels& channels) {
  const Header origin = header(time_ns, odometry_frame(vehicle.name));
  if (is_wanted(channels.odometry))
    sink_->publish(channels.odometry, time_ns,
                   messages::ros::odometry(origin, body_frame(vehicle.name), vehicle.T_local_body,
                                           {vehicle.velocity_m_s, vehicle.angular_velocity_rad_s}));
  if (is_wanted(channels.motion))
    sink_->publish(channels.motion, time_ns,
                   motion_text({vehicle.T_local_body, vehicle.velocity_m_s, vehicle.angular_velocity_rad_s}));
  if (is_wanted(channels.gnss)) {
    const geometry::Geodetic position{vehicle.latitude_deg, vehicle.longitude_deg, {vehicle.height_m}};
    const dataset::GpsFix fix{static_cast<double>(time_ns) * 1e-9, position, 0.0, 0.0};
    sink_->publish(channels.gnss, time_ns, messages::ros::nav_sat_fix(header(time_ns, body_frame(vehicle.name)), fix));
  }
}

/// Publishes where a vehicle located itself, once for each image; its true pose is that of `odometry`.
void LiveView::publish_location(const simulator::ObservedVehicle& vehicle, VehicleChannels& channels) {
  const simulator::ObservedLocation& found = *vehicle.location;
  if (found.time_ns == channels.located_ns || !is_wanted(*channels.location)) return;
  channels.located_ns = found.time_ns;
  messages::ros::OdometryCovariances covariances;
  covariances.pose.topLeftCorner<3, 3>() = found.position_covariance_m2;
  covariances.pose.bottomRightCorner<3, 3>() = found.rotation_covariance_rad2;
  covariances.velocity.topLeftCorner<3, 3>() = found.velocity_covariance_m2_s2;
  sink_->publish(*channels.location, found.time_ns,
                 messages::ros::odometry(header(found.time_ns, kMapFrame), body_frame(vehicle.name), found.T_local_body,
                                         {found.velocity_m_s, found.angular_velocity_rad_s}, covariances));
}

void LiveView::publish_picture(const Header& head, const imaging::RgbImage& picture, const CameraChannels& channels) {
  const auto time_ns = static_cast<std::uint64_t>(head.time_ns);
  if (is_wanted(channels.image)) sink_->publish(channels.image, time_ns, messages::ros::rgb_image(head, picture));
  if (is_wanted(channels.compressed))
    sink_->publish(channels.compressed, time_ns,
                   messages::ros::compressed_image(head, "jpeg", jpeg_of(picture, options_.jpeg_quality)));
}

void LiveView::publish_imu(const simulator::ObservedVehicle& vehicle, const std::string& imu, ChannelId channel) {
  if (!is_wanted(channel)) return;
  const simulator::ObservedMotion motion = simulator_()->viewer().imu(imu, vehicle.name);
  const geometry::ImuSample reading{static_cast<double>(motion.time_ns) * 1e-9, motion.angular_rate_rad_s,
                                    motion.specific_force_m_s2};
  sink_->publish(channel, motion.time_ns,
                 messages::ros::imu(header(motion.time_ns, frame_of(vehicle.name, imu)), reading));
}

/// Picture and depth of one call are of the same moment.
void LiveView::publish_camera(const simulator::ObservedVehicle& vehicle, const simulator::ObservedCamera& camera,
                              const CameraChannels& channels) {
  using simulator::ImageType;
  const std::string frame = camera_frame(vehicle.name, camera.name);
  std::vector<simulator::ImageRequest> requests;
  if (is_wanted(channels.image) || is_wanted(channels.compressed))
    requests.push_back({camera.name, static_cast<int>(ImageType::kScene), false, false});
  if (is_wanted(channels.depth))
    requests.push_back({camera.name, static_cast<int>(ImageType::kDepthPlanar), true, false});
  if (requests.empty() && !is_wanted(channels.info)) return;
  std::uint64_t time_ns = simulator_()->viewer().observe().time_ns;
  if (!requests.empty()) {
    const std::vector<simulator::ImageResponse> images = simulator_()->viewer().images(requests, vehicle.name);
    time_ns = images.front().time_stamp;
    const Header head = header(time_ns, frame);
    for (const simulator::ImageResponse& image : images) {
      if (image.pixels_as_float) {
        sink_->publish(channels.depth, time_ns, messages::ros::depth_image(head, depth_of(image)));
      } else {
        publish_picture(head, rgb_of(image), channels);
      }
    }
  }
  if (is_wanted(channels.info))
    sink_->publish(channels.info, time_ns, messages::ros::camera_info(header(time_ns, frame), camera.scene_lens));
}

void LiveView::publish_scan(const simulator::ObservedVehicle& vehicle, const simulator::ObservedLidar& lidar,
                            ChannelId channel) {
  if (!is_wanted(channel)) return;
  const simulator::ObservedScan scan = simulator_()->viewer().scan(lidar.name, vehicle.name);
  const Header head = header(scan.time_ns, frame_of(vehicle.name, lidar.name));
  sink_->publish(channel, scan.time_ns, messages::ros::point_cloud(head, points_of(scan)));
}

void LiveView::start_place() {
  if (!place_thread_.joinable()) place_thread_ = std::jthread([this] { publish_place(); });
}

void LiveView::report(const std::string& failure) {
  {
    const std::lock_guard lock(mutex_);
    if (!reported_.insert(failure).second) return;
  }
  if (log_) log_("live view: " + failure);
  sink_->warn(failure);
}

void LiveView::publish_place() try {
  const std::shared_ptr<simulator::Simulator> simulator = simulator_();
  const auto meshes = simulator->viewer().meshes(kMaxPlaceTriangles);
  if (!meshes) return report("/place: more than 8 million triangles are in memory, which are too many to show");
  const std::optional<PlaceGlb> glb = make_place_glb(*meshes, simulator->statistics().attribution);
  if (!glb) return report("/place: there are no triangles in memory");
  const std::uint64_t time_ns = simulator->viewer().observe().time_ns;
  sink_->publish(place_, time_ns, scene_update(glb->bytes, kMapFrame, time_ns, glb->attribution));
} catch (const std::exception& error) {
  report(error.what());
}

}  // namespace tileflight::publishing
