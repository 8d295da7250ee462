#pragma once

struct ddsi_serdata;
struct ddsi_sertype;

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace tileflight::ros2 {

// Messages for CycloneDDS as bytes that are already encoded (CDR with its four-byte header). Their types have a name
// and no key, as all types of ROS 2.

/// Makes a type of messages, whose ownership passes to the topic that is made of it. `max_bytes`: limit of a received
/// message; only the size of a larger one is kept.
ddsi_sertype* make_raw_type(const std::string& name, std::size_t max_bytes);

/// Makes a message that is written once.
ddsi_serdata* make_raw_message(const ddsi_sertype& type, std::string cdr);

/// A received message.
struct RawMessage {
  std::string_view cdr;  ///< empty if it is too large; with up to three bytes of padding at its end
  std::size_t size = 0;  ///< bytes, with the header
  bool is_too_large = false;
};
/// Returns the message that CycloneDDS received.
RawMessage raw_message(const ddsi_serdata& data);

/// Takes all messages that wait at a reader. `sender` is the handle of their writer (dds_instance_handle_t).
void take_all(std::int32_t reader, const std::function<void(const RawMessage& message, std::uint64_t sender)>& handle);

}  // namespace tileflight::ros2
