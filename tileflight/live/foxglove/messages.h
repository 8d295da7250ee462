#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "tileflight/live/foxglove/channel.h"

namespace tileflight::foxglove {

// What clients send: JSON objects with a key "op" (Foxglove WebSocket protocol v1, "JSON messages").

/// A client sent what is not of the protocol, or more than it may: the connection is closed. The message is one line.
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

/// An operation of the protocol, or of a later one, that this server does not have.
struct UnsupportedOperation {
  std::string op;
};

using ClientMessage = std::variant<Subscribe, Unsubscribe, GetParameters, SetParameters, SubscribeParameters,
                                   UnsubscribeParameters, UnsupportedOperation>;

/// Parses a text message of a client. Throws ProtocolError: no JSON, no object, a key that is missing or of a wrong
/// type.
ClientMessage parse_client_message(std::string_view text);

}  // namespace tileflight::foxglove
