#pragma once

#include <cstdint>
#include <string>

namespace tileflight::foxglove {

/// Number of a channel, as clients name it; never used again for another one.
using ChannelId = std::uint32_t;

/// A stream of messages of one type that clients may subscribe to (protocol: Advertise).
struct Channel {
  std::string topic;            ///< "/camera/image/compressed"
  std::string encoding;         ///< of the messages: "cdr" or "json"
  std::string schema_name;      ///< "sensor_msgs/msg/Imu"
  std::string schema_encoding;  ///< "ros2msg" or "jsonschema"
  std::string schema;           ///< the definition of the messages
  /// Whether the last message is kept for later subscribers: for topics published once, or seldom.
  bool is_latched = false;
};

}  // namespace tileflight::foxglove
