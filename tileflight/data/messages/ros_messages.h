#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "tileflight/data/dataset/dataset.h"
#include "tileflight/data/dataset/lidar_files.h"
#include "tileflight/data/dataset/sensor_files.h"

namespace tileflight::messages {

/// The definition of a type of messages, for a file or a viewer.
struct MessageSchema {
  std::string name;      ///< "sensor_msgs/msg/Imu"
  std::string encoding;  ///< of `text`: "ros2msg"
  std::string text;
};

}  // namespace tileflight::messages

/// ROS 2 messages (common_interfaces, Humble), encoded as by its middleware, with their definitions, so that Foxglove
/// and ROS 2's own tools can show them without further files.
namespace tileflight::messages::ros {

/// The definition of a message and of all nested types. Throws std::out_of_range for an unknown name.
MessageSchema schema(const std::string& name);

/// Time stamp and coordinate frame.
struct Header {
  std::int64_t time_ns = 0;
  std::string frame_id;
};

/// sensor_msgs/msg/CompressedImage; `format` is "jpeg" or "png".
std::string compressed_image(const Header& head, std::string_view format, std::string_view file_bytes);
/// sensor_msgs/msg/Image of encoding rgb8.
std::string rgb_image(const Header& head, const imaging::RgbImage& image);
/// sensor_msgs/msg/Image of encoding 32FC1: metres along the axis, infinite where there is no surface (REP 118).
std::string depth_image(const Header& head, const imaging::FloatImage& depth_m);
/// sensor_msgs/msg/CameraInfo: plumb_bob, equidistant, or no name (and a pinhole's K) for other lenses.
std::string camera_info(const Header& head, const imaging::Camera& camera);

/// Velocities in the axes of the frame that moves.
struct Velocity {
  geometry::Vec3 linear_m_s = geometry::Vec3::Zero();
  geometry::Vec3 angular_rad_s = geometry::Vec3::Zero();
};
/// Holds the covariances of a pose (position and rotation about the axes of the header's frame) and of a velocity (axes
/// of the frame that moves).
struct OdometryCovariances {
  Eigen::Matrix<double, 6, 6> pose = Eigen::Matrix<double, 6, 6>::Zero();
  Eigen::Matrix<double, 6, 6> velocity = Eigen::Matrix<double, 6, 6>::Zero();
};
/// nav_msgs/msg/Odometry; zero covariances: unknown.
std::string odometry(const Header& head, const std::string& child_frame_id, const geometry::SE3& T_frame_child,
                     const Velocity& velocity, const OdometryCovariances& covariances = {});
/// nav_msgs/msg/Path: poses in the header's frame. `epoch_ns` is added to their times.
std::string path(const Header& head, const std::vector<geometry::StampedPose>& poses, std::int64_t epoch_ns = 0);
/// rosgraph_msgs/msg/Clock
std::string clock(std::int64_t time_ns);

struct FrameTransform {
  Header head;
  std::string child_frame_id;
  geometry::SE3 T_frame_child;
};
/// tf2_msgs/msg/TFMessage
std::string transforms(const std::vector<FrameTransform>& transforms);
/// tf2_msgs/msg/TFMessage with one transform.
std::string transform(const Header& head, const std::string& child_frame_id, const geometry::SE3& T_frame_child);
/// sensor_msgs/msg/Imu without orientation.
std::string imu(const Header& head, const geometry::ImuSample& reading);
/// sensor_msgs/msg/NavSatFix; altitude above the ellipsoid, as that message defines it.
std::string nav_sat_fix(const Header& head, const dataset::GpsFix& fix);
/// sensor_msgs/msg/PointCloud2 with x, y, z, intensity, time (seconds after the stamp) and ring.
std::string point_cloud(const Header& head, const std::vector<dataset::ScanPoint>& points);
/// sensor_msgs/msg/FluidPressure, pascals.
std::string fluid_pressure(const Header& head, double pressure_pa);
/// sensor_msgs/msg/MagneticField; given in microtesla, written in tesla.
std::string magnetic_field(const Header& head, const geometry::Vec3& field_ut);
/// sensor_msgs/msg/Range
std::string range(const Header& head, double range_m);

}  // namespace tileflight::messages::ros
