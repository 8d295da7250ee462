// Watches one vehicle of `tileflight serve --ros2`: receives all of its topics for some seconds, then prints the node
// graph, and for each topic its type, count, rate and last message.
//
//   ros2 run tileflight_ros2_example watch --ros-args -p vehicle:=drone -p seconds:=10.0
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <memory>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "nav_msgs/msg/odometry.hpp"
#include "nav_msgs/msg/path.hpp"
#include "rclcpp/rclcpp.hpp"
#include "rosgraph_msgs/msg/clock.hpp"
#include "sensor_msgs/msg/camera_info.hpp"
#include "sensor_msgs/msg/compressed_image.hpp"
#include "sensor_msgs/msg/image.hpp"
#include "sensor_msgs/msg/imu.hpp"
#include "sensor_msgs/msg/nav_sat_fix.hpp"
#include "sensor_msgs/msg/point_cloud2.hpp"
#include "tf2_msgs/msg/tf_message.hpp"

namespace {

using sensor_msgs::msg::CameraInfo;
using sensor_msgs::msg::CompressedImage;
using sensor_msgs::msg::Image;
using sensor_msgs::msg::Imu;
using sensor_msgs::msg::NavSatFix;
using sensor_msgs::msg::PointCloud2;
using tf2_msgs::msg::TFMessage;

template <class... Parts>
std::string text(const Parts&... parts) {
  std::ostringstream out;
  (out << ... << parts);
  return out.str();
}

std::string describe(const std_msgs::msg::Header& header) {
  char time[40];
  std::snprintf(time, sizeof time, "%d.%09u", header.stamp.sec, header.stamp.nanosec);
  return text(time, " ", header.frame_id, ", ");
}

template <class Vector>
std::string xyz(const Vector& v) {
  return text("(", v.x, " ", v.y, " ", v.z, ")");
}

std::string describe(const Image& image) {
  std::string values;
  if (image.encoding == "32FC1") {
    float least = std::numeric_limits<float>::infinity(), most = 0.0F;
    for (std::size_t i = 0; i + sizeof least <= image.data.size(); i += sizeof least) {
      float depth_m = 0.0F;
      std::memcpy(&depth_m, &image.data[i], sizeof depth_m);
      least = std::min(least, depth_m);
      if (std::isfinite(depth_m)) most = std::max(most, depth_m);
    }
    values = text(least, " to ", most, " m");
  } else {
    double sum = 0.0;
    for (const unsigned char value : image.data) sum += value;
    values = text("mean ", sum / std::max<double>(1.0, static_cast<double>(image.data.size())));
  }
  return text(describe(image.header), image.encoding, " ", image.width, " x ", image.height, ", step ", image.step,
              ", ", image.data.size(), " bytes, ", values);
}

std::string describe(const CompressedImage& image) {
  return text(describe(image.header), image.format, ", ", image.data.size(), " bytes");
}

std::string describe(const CameraInfo& info) {
  return text(describe(info.header), info.width, " x ", info.height, ", ", info.distortion_model, " with ",
              info.d.size(), " coefficients, fx ", info.k[0], " fy ", info.k[4], " cx ", info.k[2], " cy ", info.k[5]);
}

std::string describe(const PointCloud2& cloud) {
  std::string fields;
  for (const auto& field : cloud.fields) fields += text(field.name, "@", field.offset, " ");
  return text(describe(cloud.header), cloud.width * cloud.height, " points of ", cloud.point_step, " bytes: ", fields);
}

std::string describe(const Imu& imu) {
  return text(describe(imu.header), "angular velocity ", xyz(imu.angular_velocity), " rad/s, acceleration ",
              xyz(imu.linear_acceleration), " m/s2");
}

std::string describe(const NavSatFix& fix) {
  char position[100];
  std::snprintf(position, sizeof position, "%.7f %.7f %.3f", fix.latitude, fix.longitude, fix.altitude);
  return text(describe(fix.header), position);
}

std::string describe(const nav_msgs::msg::Odometry& odometry) {
  return text(describe(odometry.header), odometry.child_frame_id, " at ", xyz(odometry.pose.pose.position), " m, ",
              xyz(odometry.twist.twist.linear), " m/s");
}

std::string describe(const nav_msgs::msg::Path& path) {
  return text(describe(path.header), path.poses.size(), " poses");
}

std::string describe(const TFMessage& message) {
  std::string all;
  for (const auto& one : message.transforms)
    all += text(one.header.frame_id, " -> ", one.child_frame_id, " ", xyz(one.transform.translation), "; ");
  return all;
}

std::string describe(const rosgraph_msgs::msg::Clock& clock) {
  char time[40];
  std::snprintf(time, sizeof time, "%d.%09u", clock.clock.sec, clock.clock.nanosec);
  return time;
}

const char* name(rclcpp::ReliabilityPolicy policy) {
  return policy == rclcpp::ReliabilityPolicy::Reliable ? "reliable" : "best effort";
}

const char* name(rclcpp::DurabilityPolicy policy) {
  return policy == rclcpp::DurabilityPolicy::TransientLocal ? "transient local" : "volatile";
}

using Clock = std::chrono::steady_clock;

struct Seen {
  std::string topic, type, last;
  int count = 0, incompatible = 0;
  Clock::time_point first, latest;
};

class Watch : public rclcpp::Node {
 public:
  Watch() : Node("watch") {
    const std::string vehicle = "/" + declare_parameter<std::string>("vehicle", "drone");
    const std::string camera = vehicle + "/" + declare_parameter<std::string>("camera", "front_center");
    const std::string lidar = vehicle + "/" + declare_parameter<std::string>("lidar", "lidar");
    const std::string imu = vehicle + "/" + declare_parameter<std::string>("imu", "imu");
    const rclcpp::QoS reliable(10), latched = rclcpp::QoS(10).transient_local();
    const rclcpp::SensorDataQoS sensor;
    add<Image>(camera + "/image", reliable);  // as RViz
    add<CompressedImage>(camera + "/image/compressed", sensor);
    add<Image>(camera + "/depth", sensor);
    add<CameraInfo>(camera + "/camera_info", reliable);
    add<PointCloud2>(lidar + "/points", sensor);
    add<Imu>(imu + "/data_raw", sensor);
    add<nav_msgs::msg::Odometry>(vehicle + "/odometry", reliable);
    add<nav_msgs::msg::Path>(vehicle + "/path", latched);
    add<NavSatFix>(vehicle + "/gnss", reliable);
    add<TFMessage>("/tf", rclcpp::QoS(100));
    add<TFMessage>("/tf_static", latched);
    add<rosgraph_msgs::msg::Clock>("/clock", rclcpp::ClockQoS());
  }

  void print_graph() const {
    std::printf("nodes:");
    for (const std::string& node : get_node_names()) std::printf(" %s", node.c_str());
    std::printf("\nservices:");
    for (const auto& [service, types] : get_service_names_and_types()) {
      if (service.rfind("/tileflight/", 0) == 0) std::printf(" %s [%s]", service.c_str(), types.front().c_str());
    }
    std::printf("\n");
    for (const auto& [topic, types] : get_topic_names_and_types()) {
      for (const auto& writer : get_publishers_info_by_topic(topic)) print_endpoint(topic, "sent by", writer);
      for (const auto& reader : get_subscriptions_info_by_topic(topic)) {
        if (reader.node_name() != get_name()) print_endpoint(topic, "taken by", reader);
      }
    }
  }

  void print_messages() const {
    for (const auto& seen : all_) {
      const double seconds = std::chrono::duration<double>(seen->latest - seen->first).count();
      std::printf("%s [%s]: %d messages, %.1f Hz", seen->topic.c_str(), seen->type.c_str(), seen->count,
                  seconds > 0.0 ? (seen->count - 1) / seconds : 0.0);
      if (seen->incompatible > 0) std::printf(", %d writers with incompatible QoS", seen->incompatible);
      std::printf("\n    %s\n", seen->last.c_str());
    }
    std::printf("the node's time: %.3f s\n", now().seconds());  // simulated with use_sim_time
  }

  /// Returns whether each topic had a message and no writer was incompatible.
  bool is_complete() const {
    return std::all_of(all_.begin(), all_.end(), [](const auto& s) { return s->count > 0 && s->incompatible == 0; });
  }

 private:
  template <class Message>
  void add(const std::string& topic, const rclcpp::QoS& qos) {
    auto seen = std::make_shared<Seen>();
    seen->topic = topic;
    seen->type = rosidl_generator_traits::name<Message>();
    rclcpp::SubscriptionOptions options;
    options.event_callbacks.incompatible_qos_callback = [seen](rclcpp::QOSRequestedIncompatibleQoSInfo& info) {
      seen->incompatible = info.total_count;
    };
    const auto take = [seen](const std::shared_ptr<const Message> message) {
      seen->latest = Clock::now();
      if (seen->count++ == 0) seen->first = seen->latest;
      seen->last = describe(*message);
    };
    subscriptions_.push_back(create_subscription<Message>(topic, qos, take, options));
    all_.push_back(std::move(seen));
  }

  static void print_endpoint(const std::string& topic, const char* how, const rclcpp::TopicEndpointInfo& end) {
    std::printf("%s [%s] %s %s%s: %s, %s\n", topic.c_str(), end.topic_type().c_str(), how, end.node_namespace().c_str(),
                end.node_name().c_str(), name(end.qos_profile().reliability()), name(end.qos_profile().durability()));
  }

  std::vector<std::shared_ptr<Seen>> all_;
  std::vector<rclcpp::SubscriptionBase::SharedPtr> subscriptions_;
};

}  // namespace

int main(int argc, char** argv) {
  rclcpp::init(argc, argv);
  const auto node = std::make_shared<Watch>();
  const std::chrono::duration<double> length(node->declare_parameter<double>("seconds", 10.0));
  rclcpp::executors::SingleThreadedExecutor executor;
  executor.add_node(node);
  const auto end = Clock::now() + length;
  while (rclcpp::ok() && Clock::now() < end) executor.spin_once(std::chrono::milliseconds(100));
  node->print_graph();
  node->print_messages();
  const bool is_complete = node->is_complete();
  rclcpp::shutdown();
  return is_complete ? 0 : 1;
}
