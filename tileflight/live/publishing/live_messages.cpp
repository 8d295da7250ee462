#include "tileflight/live/publishing/live_messages.h"

#include <algorithm>
#include <limits>

#include "tileflight/core/imaging/image_files.h"

namespace tileflight::publishing {
namespace {

/// AirSim's depth where there is no surface.
constexpr float kNoSurface_m = 65504.0F;

bool is_same(const geometry::SE3& a, const geometry::SE3& b) {
  return a.translation == b.translation && a.rotation.coeffs() == b.rotation.coeffs();
}

}  // namespace

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

}  // namespace tileflight::publishing
