#pragma once

struct dds_listener;
struct ddsi_sertype;

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "tileflight/live/ros2/participant.h"

namespace tileflight::ros2 {

// These functions give the names of topics, services and types that ROS 2's middlewares use in DDS (design.ros2.org,
// "Topic and Service name mapping to DDS"; rosidl's names of generated types).

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

/// Makes a name that ROS 2 allows: between slashes letters, digits and underscores, and no digit first. Other
/// characters become underscores, and a token that begins with a digit gets the prefix "id_" (one that begins with an
/// underscore would be hidden): "/Drone 1/0/image" → "/Drone_1/id_0/image".
std::string valid_name(std::string_view name);

/// The parts of DDS's quality of service that ROS 2's nodes choose and compare.
struct QualityOfService {
  /// A reliable writer serves readers that ask for reliability and those that do not; a best-effort writer only the
  /// latter. A best-effort reader takes from both.
  bool is_reliable = true;
  bool is_latched = false;   ///< transient local: later subscribers get the last message
  std::uint32_t depth = 10;  ///< "keep last": how many messages wait for a reader, at most
};

// Creation of readers and writers, for this room.

/// An entity of DDS with its topic, deleted with it.
class Entity {
 public:
  /// `user_data`: text that others see ("serviceid=…;"), may be empty. `max_bytes`: limit of a received message.
  struct Options {
    std::string topic, type;  ///< DDS's names
    QualityOfService quality;
    std::string user_data;
    std::size_t max_bytes = std::size_t{64} << 10U;
  };
  /// Throws InputError (topic, cause).
  Entity(Participant& participant, Participant::Kind kind, const Options& options, const dds_listener* listener);
  ~Entity();
  Entity(const Entity&) = delete;
  Entity& operator=(const Entity&) = delete;

  std::int32_t handle() const { return handle_; }
  const ddsi_sertype& type() const { return *type_; }
  /// Writes a message (CDR). Returns false if it could not be written.
  bool write(std::string cdr) const;

 private:
  Participant& participant_;
  Participant::Kind kind_;
  std::int32_t topic_ = 0, handle_ = 0;
  ddsi_sertype* type_ = nullptr;
};

}  // namespace tileflight::ros2
