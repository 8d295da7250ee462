#pragma once

struct ddsi_serdata;
struct ddsi_sertype;

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

namespace tileflight::ros2 {

// Messages as CycloneDDS sees them here: bytes that are encoded already (CDR with its four-byte header), of a type that
// has a name alone and no key, as all of ROS 2's.

/// A type of messages; whoever makes a topic of it hands it over. `max_bytes`: of a received message; of a larger one
/// only the size is kept.
ddsi_sertype* make_raw_type(const std::string& name, std::size_t max_bytes);

/// A message, to be written once.
ddsi_serdata* make_raw_message(const ddsi_sertype& type, std::string cdr);

/// A message received.
struct RawMessage {
  std::string_view cdr;  ///< empty if it is too large; with up to three bytes of padding at its end
  std::size_t size = 0;  ///< bytes, with the header
  bool is_too_large = false;
};
RawMessage raw_message(const ddsi_serdata& data);

/// Takes all messages that wait at a reader; `sender` names their writer (dds_instance_handle_t).
void take_all(std::int32_t reader, const std::function<void(const RawMessage& message, std::uint64_t sender)>& handle);

}  // namespace tileflight::ros2
