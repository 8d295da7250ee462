#include <cstdlib>
#include <nlohmann/json.hpp>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/live/foxglove/client_session.h"

namespace {

using namespace tileflight;

foxglove::ClientSession::Channels make_channels() {
  foxglove::ClientSession::Channels channels;
  channels[1].channel = {"/image", "cdr", "sensor_msgs/msg/CompressedImage", "ros2msg", "uint8[] data"};
  channels[2].channel = {"/place", "json", "foxglove.SceneUpdate", "jsonschema", "{}", true};
  channels[2].last = std::make_shared<const std::string>("{}");
  return channels;
}

foxglove::ParameterAccess make_parameters() {
  foxglove::ParameterAccess access;
  access.read = [] { return std::vector<foxglove::Parameter>{{"rate", 1.0}, {"paused", false}}; };
  access.write = [](const foxglove::Parameter& wanted) {
    if (wanted.name != "rate") throw InputError(wanted.name, "is not known");
  };
  return access;
}

/// Every text that leaves the server is JSON, and every message is of a channel that was subscribed to.
void check_answers(foxglove::ClientSession& session) {
  while (const auto message = session.next()) {
    if (message->is_text && !nlohmann::json::accept(message->head)) std::abort();
    if (!message->is_text && message->head.size() != 13 && message->head.size() != 9) std::abort();
  }
}

}  // namespace

/// The text messages of a client, one a line, as they come from its WebSocket.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const foxglove::ClientSession::Channels channels = make_channels();
  static const foxglove::ParameterAccess parameters = make_parameters();
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  foxglove::ClientSession session("fuzz", "1", channels, parameters);
  try {
    for (std::size_t from = 0; from < size;) {
      const std::size_t end = std::min(bytes.find('\n', from), size);
      session.receive(bytes.substr(from, end - from));
      session.offer({1, 5, std::make_shared<const std::string>("pixels")}, false, 1000);
      check_answers(session);
      from = end + 1;
    }
  } catch (const foxglove::ProtocolError&) {
    // the connection is closed
  }
  return 0;
}
