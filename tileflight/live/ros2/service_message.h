#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace tileflight::ros2 {

/// A request as rmw_cyclonedds_cpp sends it: before the message's fields, 16 bytes that say whose it is, which keep the
/// alignment of what follows.
struct ServiceMessage {
  std::uint64_t client = 0;
  std::int64_t sequence_number = 0;
  std::string body;  ///< CDR with its four-byte header, without those 16 bytes
};

/// Throws InputError (`what`, cause).
ServiceMessage read_service_message(std::string_view cdr, const std::string& what);
std::string write_service_message(const ServiceMessage& message);

}  // namespace tileflight::ros2
