#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace tileflight::foxglove {

/// Value of a parameter; std::monostate for a kind that no parameter here has (an array, an object, none).
using ParameterValue = std::variant<std::monostate, bool, double, std::string>;

/// A value that clients see and may set.
struct Parameter {
  std::string name;
  ParameterValue value;
};

/// Access to the parameters behind a server. Called by the server's thread; neither function may call the server.
struct ParameterAccess {
  /// Returns all parameters in the order in which they are listed.
  std::function<std::vector<Parameter>()> read = [] { return std::vector<Parameter>{}; };
  /// Sets a parameter. Throws InputError (name, cause) for an unknown name or an unusable value.
  std::function<void(const Parameter&)> write = {};
};

/// Number of a channel, by which clients name it. No other channel gets it again.
using ChannelId = std::uint32_t;

/// A stream of messages of one type that clients may subscribe to (protocol: Advertise).
struct Channel {
  std::string topic;            ///< "/camera/image/compressed"
  std::string encoding;         ///< encoding of the messages: "cdr" or "json"
  std::string schema_name;      ///< "sensor_msgs/msg/Imu"
  std::string schema_encoding;  ///< "ros2msg" or "jsonschema"
  std::string schema;           ///< the definition of the messages
  /// Keeps the last message for later subscribers, for topics that are published once or seldom.
  bool is_latched = false;
};

// The server sends JSON texts and binary messages (Foxglove WebSocket protocol v1). These functions make the texts and
// the heads of the binary messages.

/// Makes a Server Info: `name`, the capabilities parameters, parametersSubscribe and time, and a session id by which a
/// client tells a new server from a reconnection.
std::string server_info_text(const std::string& name, const std::string& session_id);

/// Level of a status, with the protocol's numbers.
enum class StatusLevel : int { kInfo = 0, kWarning = 1, kError = 2 };
/// Makes a Status.
std::string status_text(StatusLevel level, const std::string& message);

/// Makes an Advertise of channels.
std::string advertise_text(const std::vector<std::pair<ChannelId, Channel>>& channels);
/// Makes an Unadvertise of channels.
std::string unadvertise_text(const std::vector<ChannelId>& channels);

/// Makes a Parameter Values; `id` is that of the request.
std::string parameter_values_text(const std::vector<Parameter>& parameters, const std::optional<std::string>& id);

/// Makes the head of a Message Data: opcode 1, subscription (uint32), time in nanoseconds (uint64), little-endian; the
/// message's own bytes follow.
std::string message_data_head(std::uint32_t subscription, std::uint64_t time_ns);

/// Makes a Time message: opcode 2, time in nanoseconds (uint64), little-endian.
std::string time_message(std::uint64_t time_ns);

// Clients send JSON objects with a key "op" (Foxglove WebSocket protocol v1, "JSON messages").

/// A client broke the protocol or exceeded a limit: its connection is closed. The message is one line.
struct ProtocolError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Subscription {
  std::uint32_t id = 0;  ///< chosen by the client
  ChannelId channel = 0;
};

struct Subscribe {
  std::vector<Subscription> subscriptions;
};

struct Unsubscribe {
  std::vector<std::uint32_t> ids;
};

struct GetParameters {
  std::vector<std::string> names;  ///< empty: all
  std::optional<std::string> id;   ///< returned with the answer
};

struct SetParameters {
  std::vector<Parameter> parameters;
  std::optional<std::string> id;  ///< none: no answer is expected
};

struct SubscribeParameters {
  std::vector<std::string> names;  ///< empty: all
};

struct UnsubscribeParameters {
  std::vector<std::string> names;  ///< empty: all
};

/// An operation that this server does not support, of this protocol or of a later version.
struct UnsupportedOperation {
  std::string op;
};

using ClientMessage = std::variant<Subscribe, Unsubscribe, GetParameters, SetParameters, SubscribeParameters,
                                   UnsubscribeParameters, UnsupportedOperation>;

/// Parses a text message of a client. Throws ProtocolError: no JSON, no object, a key that is missing or of a wrong
/// type.
ClientMessage parse_client_message(std::string_view text);

}  // namespace tileflight::foxglove
