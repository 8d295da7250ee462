#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

namespace tileflight::foxglove {

/// std::monostate: a value of a kind that no parameter here has (an array, an object, none).
using ParameterValue = std::variant<std::monostate, bool, double, std::string>;

/// A value that clients see and may set.
struct Parameter {
  std::string name;
  ParameterValue value;
};

/// Access to the parameters behind a server. Called by the server's thread; neither function may call the server.
struct ParameterAccess {
  /// All parameters, in the order in which they are listed.
  std::function<std::vector<Parameter>()> read = [] { return std::vector<Parameter>{}; };
  /// Sets one of them. Throws InputError (name, cause) for an unknown name or an unusable value.
  std::function<void(const Parameter&)> write = {};
};

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
