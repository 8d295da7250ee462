// Definitions: https://github.com/ros2/common_interfaces (Humble), fields only.
#include "tileflight/data/messages/ros_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <span>
#include <variant>

#include "tileflight/data/messages/cdr.h"

namespace tileflight::messages::ros {

namespace {

struct Definition {
  std::string fields;
  std::vector<std::string> dependencies;  ///< nested message types, including theirs
};

const std::map<std::string, Definition>& definitions() {
  static const std::map<std::string, Definition> kDefinitions{
      {"builtin_interfaces/Time", {"int32 sec\nuint32 nanosec\n", {}}},
      {"std_msgs/Header", {"builtin_interfaces/Time stamp\nstring frame_id\n", {"builtin_interfaces/Time"}}},
      {"geometry_msgs/Vector3", {"float64 x\nfloat64 y\nfloat64 z\n", {}}},
      {"geometry_msgs/Quaternion", {"float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n", {}}},
      {"geometry_msgs/Transform",
       {"geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n",
        {"geometry_msgs/Vector3", "geometry_msgs/Quaternion"}}},
      {"geometry_msgs/TransformStamped",
       {"std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n",
        {"std_msgs/Header", "geometry_msgs/Transform"}}},
      {"geometry_msgs/Point", {"float64 x\nfloat64 y\nfloat64 z\n", {}}},
      {"geometry_msgs/Pose",
       {"geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        {"geometry_msgs/Point", "geometry_msgs/Quaternion"}}},
      {"geometry_msgs/PoseStamped",
       {"std_msgs/Header header\ngeometry_msgs/Pose pose\n", {"std_msgs/Header", "geometry_msgs/Pose"}}},
      {"geometry_msgs/PoseWithCovariance",
       {"geometry_msgs/Pose pose\nfloat64[36] covariance\n", {"geometry_msgs/Pose"}}},
      {"geometry_msgs/Twist",
       {"geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular\n", {"geometry_msgs/Vector3"}}},
      {"geometry_msgs/TwistWithCovariance",
       {"geometry_msgs/Twist twist\nfloat64[36] covariance\n", {"geometry_msgs/Twist"}}},
      {"nav_msgs/Odometry",
       {"std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
        "geometry_msgs/TwistWithCovariance twist\n",
        {"std_msgs/Header", "geometry_msgs/PoseWithCovariance", "geometry_msgs/TwistWithCovariance"}}},
      {"nav_msgs/Path",
       {"std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
        {"std_msgs/Header", "geometry_msgs/PoseStamped"}}},
      {"rosgraph_msgs/Clock", {"builtin_interfaces/Time clock\n", {"builtin_interfaces/Time"}}},
      {"sensor_msgs/Image",
       {"std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data\n",
        {"std_msgs/Header"}}},
      {"tf2_msgs/TFMessage", {"geometry_msgs/TransformStamped[] transforms\n", {"geometry_msgs/TransformStamped"}}},
      {"sensor_msgs/CompressedImage", {"std_msgs/Header header\nstring format\nuint8[] data\n", {"std_msgs/Header"}}},
      {"sensor_msgs/RegionOfInterest",
       {"uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n", {}}},
      {"sensor_msgs/CameraInfo",
       {"std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi\n",
        {"std_msgs/Header", "sensor_msgs/RegionOfInterest"}}},
      {"sensor_msgs/Imu",
       {"std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n",
        {"std_msgs/Header", "geometry_msgs/Quaternion", "geometry_msgs/Vector3"}}},
      {"sensor_msgs/NavSatStatus", {"int8 status\nuint16 service\n", {}}},
      {"sensor_msgs/NavSatFix",
       {"std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
        "float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type\n",
        {"std_msgs/Header", "sensor_msgs/NavSatStatus"}}},
      {"sensor_msgs/PointField", {"string name\nuint32 offset\nuint8 datatype\nuint32 count\n", {}}},
      {"sensor_msgs/PointCloud2",
       {"std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense\n",
        {"std_msgs/Header", "sensor_msgs/PointField"}}},
      {"sensor_msgs/FluidPressure",
       {"std_msgs/Header header\nfloat64 fluid_pressure\nfloat64 variance\n", {"std_msgs/Header"}}},
      {"sensor_msgs/MagneticField",
       {"std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance\n",
        {"std_msgs/Header", "geometry_msgs/Vector3"}}},
      {"sensor_msgs/Range",
       {"std_msgs/Header header\nuint8 radiation_type\nfloat32 field_of_view\nfloat32 min_range\nfloat32 max_range\n"
        "float32 range\n",
        {"std_msgs/Header"}}}};
  return kDefinitions;
}

/// Collects each nested type once, recursively.
void collect_dependencies(const std::string& name, std::vector<std::string>& parts) {
  for (const std::string& part : definitions().at(name).dependencies) {
    if (std::find(parts.begin(), parts.end(), part) != parts.end()) continue;
    parts.push_back(part);
    collect_dependencies(part, parts);
  }
}

constexpr std::array<double, 9> kUnknownCovariance{};  ///< all zeros
constexpr std::array<double, 9> kNoEstimate{-1.0, 0, 0, 0, 0, 0, 0, 0, 0};

CdrWriter& put(CdrWriter& writer, std::int64_t time_ns) {
  constexpr std::int64_t kSecond_ns = 1000000000;
  writer.number(static_cast<std::int32_t>(time_ns / kSecond_ns));
  return writer.number(static_cast<std::uint32_t>(time_ns % kSecond_ns));
}

CdrWriter& put(CdrWriter& writer, const Header& head) { return put(writer, head.time_ns).text(head.frame_id); }

CdrWriter begin_message(const Header& head) {
  CdrWriter writer;
  put(writer, head);
  return writer;
}

CdrWriter& put(CdrWriter& writer, const geometry::Vec3& v) { return writer.number(v.x()).number(v.y()).number(v.z()); }

/// A pose or a transform, whose fields are the same.
CdrWriter& put(CdrWriter& writer, const geometry::SE3& T) {
  const Eigen::Quaterniond& q = T.rotation;
  return put(writer, T.translation).array(std::array{q.x(), q.y(), q.z(), q.w()});
}

/// sensor_msgs/msg/Image: the pixels as they lie in memory, row by row.
template <class Image>
std::string image_message(const Header& head, std::string_view encoding, const Image& image) {
  CdrWriter writer = begin_message(head);
  writer.number(static_cast<std::uint32_t>(image.height)).number(static_cast<std::uint32_t>(image.width));
  const auto row_bytes = static_cast<std::uint32_t>(static_cast<std::size_t>(image.width) * sizeof image.pixels[0]);
  writer.text(encoding).number(std::uint8_t{0}).number(row_bytes);
  const auto bytes = std::as_bytes(std::span(image.pixels));
  return writer.blob({reinterpret_cast<const char*>(bytes.data()), bytes.size()}).bytes();
}

struct Lens {
  std::string name;
  std::vector<double> coefficients;
};

bool without_prism(const imaging::PinholeRational& m) {
  return std::all_of(m.d.begin() + 8, m.d.end(), [](double s) { return s == 0.0; });
}

Lens lens_of(const imaging::CameraModel& model) {
  if (const auto* m = std::get_if<imaging::PinholeRadtan>(&model))
    return {"plumb_bob", {m->d[0], m->d[1], m->d[2], m->d[3], 0.0}};
  if (const auto* m = std::get_if<imaging::PinholeRational>(&model); m != nullptr && without_prism(*m))
    return {"rational_polynomial", {m->d.begin(), m->d.begin() + 8}};
  if (const auto* m = std::get_if<imaging::KannalaBrandt>(&model)) return {"equidistant", {m->k.begin(), m->k.end()}};
  return {};
}

}  // namespace

MessageSchema schema(const std::string& name) {
  const std::size_t slash = name.find('/');
  const std::string short_name = name.substr(0, slash) + name.substr(name.rfind('/'));
  std::vector<std::string> parts;
  collect_dependencies(short_name, parts);
  std::string text = definitions().at(short_name).fields;
  for (const std::string& part : parts)
    text += std::string(80, '=') + "\nMSG: " + part + "\n" + definitions().at(part).fields;
  return {name, "ros2msg", text};
}

std::string compressed_image(const Header& head, std::string_view format, std::string_view file_bytes) {
  return begin_message(head).text(format).blob(file_bytes).bytes();
}

std::string rgb_image(const Header& head, const imaging::RgbImage& image) { return image_message(head, "rgb8", image); }

std::string depth_image(const Header& head, const imaging::FloatImage& depth_m) {
  return image_message(head, "32FC1", depth_m);
}

std::string camera_info(const Header& head, const imaging::Camera& camera) {
  const auto [fx, fy, cx, cy] = std::visit(
      [](const auto& m) {
        return std::array{m.fx, m.fy, m.cx, m.cy};
      },
      camera.model());
  const Lens lens = lens_of(camera.model());
  CdrWriter writer = begin_message(head);
  writer.number(static_cast<std::uint32_t>(camera.height())).number(static_cast<std::uint32_t>(camera.width()));
  writer.text(lens.name).number(static_cast<std::uint32_t>(lens.coefficients.size())).array(lens.coefficients);
  writer.array(std::array{fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0});
  writer.array(std::array{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0});
  writer.array(std::array{fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0});
  writer.array(std::array<std::uint32_t, 6>{}).number(std::uint8_t{0});
  return writer.bytes();
}

std::string transforms(const std::vector<FrameTransform>& transforms) {
  CdrWriter writer;
  writer.number(static_cast<std::uint32_t>(transforms.size()));
  for (const FrameTransform& one : transforms) put(put(writer, one.head).text(one.child_frame_id), one.T_frame_child);
  return writer.bytes();
}

std::string transform(const Header& head, const std::string& child_frame_id, const geometry::SE3& T_frame_child) {
  return transforms({{head, child_frame_id, T_frame_child}});
}

std::string odometry(const Header& head, const std::string& child_frame_id, const geometry::SE3& T_frame_child,
                     const Velocity& velocity, const OdometryCovariances& covariances) {
  // A covariance is symmetric, so that the order of its elements does not matter.
  const auto elements = [](const Eigen::Matrix<double, 6, 6>& covariance) {
    std::array<double, 36> all;
    std::copy_n(covariance.data(), all.size(), all.begin());
    return all;
  };
  CdrWriter writer = begin_message(head);
  writer.text(child_frame_id);
  put(writer, T_frame_child).array(elements(covariances.pose));
  put(writer, velocity.linear_m_s);
  return put(writer, velocity.angular_rad_s).array(elements(covariances.velocity)).bytes();
}

std::string path(const Header& head, const std::vector<geometry::StampedPose>& poses, std::int64_t epoch_ns) {
  CdrWriter writer = begin_message(head);
  writer.number(static_cast<std::uint32_t>(poses.size()));
  for (const geometry::StampedPose& pose : poses) {
    put(writer, Header{std::llround(1e9 * pose.time_s) + epoch_ns, head.frame_id});
    put(writer, pose.T_local_camera);
  }
  return writer.bytes();
}

std::string clock(std::int64_t time_ns) {
  CdrWriter writer;
  return put(writer, time_ns).bytes();
}

std::string imu(const Header& head, const geometry::ImuSample& reading) {
  CdrWriter writer = begin_message(head);
  writer.array(std::array{0.0, 0.0, 0.0, 1.0}).array(kNoEstimate);
  put(writer, reading.angular_rate_rad_s).array(kUnknownCovariance);
  return put(writer, reading.specific_force_m_s2).array(kUnknownCovariance).bytes();
}

std::string nav_sat_fix(const Header& head, const dataset::GpsFix& fix) {
  constexpr std::uint8_t kDiagonalKnown = 2;
  const double level = fix.horizontal_sigma_m * fix.horizontal_sigma_m;
  CdrWriter writer = begin_message(head);
  writer.number(std::int8_t{0}).number(std::uint16_t{1});  // STATUS_FIX, SERVICE_GPS
  writer.array(std::array{fix.position.latitude_deg, fix.position.longitude_deg, fix.position.height.m});
  writer.array(std::array{level, 0.0, 0.0, 0.0, level, 0.0, 0.0, 0.0, fix.vertical_sigma_m * fix.vertical_sigma_m});
  return writer.number(kDiagonalKnown).bytes();
}

std::string point_cloud(const Header& head, const std::vector<dataset::ScanPoint>& points) {
  constexpr std::uint8_t kFloat32 = 7, kUint16 = 4;
  constexpr std::uint32_t kStep = 22;
  struct Field {
    const char* name;
    std::uint32_t offset;
    std::uint8_t type;
  };
  CdrWriter writer = begin_message(head);
  const auto count = static_cast<std::uint32_t>(points.size());
  writer.number(std::uint32_t{1}).number(count).number(std::uint32_t{6});
  for (const Field& field : {Field{"x", 0, kFloat32},
                             {"y", 4, kFloat32},
                             {"z", 8, kFloat32},
                             {"intensity", 12, kFloat32},
                             {"time", 16, kFloat32},
                             {"ring", 20, kUint16}})
    writer.text(field.name).number(field.offset).number(field.type).number(std::uint32_t{1});
  std::string data;
  data.reserve(points.size() * kStep);
  for (const dataset::ScanPoint& point : points) {
    const std::array<float, 5> v{point.position.x(), point.position.y(), point.position.z(), point.intensity,
                                 point.time_s};
    data.append(reinterpret_cast<const char*>(v.data()), sizeof v);
    data.append(reinterpret_cast<const char*>(&point.ring), sizeof point.ring);
  }
  writer.number(std::uint8_t{0}).number(kStep).number(kStep * count).blob(data);
  return writer.number(std::uint8_t{1}).bytes();
}

std::string fluid_pressure(const Header& head, double pressure_pa) {
  return begin_message(head).number(pressure_pa).number(0.0).bytes();
}

std::string magnetic_field(const Header& head, const geometry::Vec3& field_ut) {
  CdrWriter writer = begin_message(head);
  return put(writer, 1e-6 * field_ut).array(kUnknownCovariance).bytes();
}

std::string range(const Header& head, double range_m) {
  constexpr std::uint8_t kInfrared = 1;
  return begin_message(head)
      .number(kInfrared)
      .array(std::array{0.0F, 0.0F, std::numeric_limits<float>::infinity()})
      .number(static_cast<float>(range_m))
      .bytes();
}

}  // namespace tileflight::messages::ros
