#pragma once

#include <string>
#include <string_view>

namespace tileflight::ros2 {

// How ROS 2's middlewares name topics, services and types in DDS (design.ros2.org, "Topic and Service name mapping to
// DDS"; rosidl's names of generated types).

/// "/drone/imu" → "rt/drone/imu"
std::string dds_topic(std::string_view topic);
/// "/drone/reset" → "rq/drone/resetRequest" and "rr/drone/resetReply"
std::string dds_request_topic(std::string_view service);
std::string dds_reply_topic(std::string_view service);
/// "sensor_msgs/msg/Imu" → "sensor_msgs::msg::dds_::Imu_"
std::string dds_type(std::string_view type);
/// "std_srvs/srv/Trigger" → "std_srvs::srv::dds_::Trigger_Request_" and "std_srvs::srv::dds_::Trigger_Response_"
std::string dds_request_type(std::string_view service_type);
std::string dds_response_type(std::string_view service_type);

/// A name that ROS 2 allows: between slashes letters, digits and underscores, and no digit first. What is not allowed
/// becomes an underscore, and a token that begins with a digit begins with "id_" instead (one that begins with an
/// underscore would be hidden): "/Drone 1/0/image" → "/Drone_1/id_0/image".
std::string valid_name(std::string_view name);

}  // namespace tileflight::ros2
