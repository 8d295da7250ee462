#include "tileflight/live/ros2/service_message.h"

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/messages/cdr.h"

namespace tileflight::ros2 {
namespace {

constexpr std::size_t kHeader = 4, kIdentity = 16;

}  // namespace

ServiceMessage read_service_message(std::string_view cdr, const std::string& what) {
  if (cdr.size() < kHeader + kIdentity)
    throw InputError(what, "a request does not say whose it is; clients need RMW_IMPLEMENTATION=rmw_cyclonedds_cpp");
  messages::CdrReader reader(cdr, what);
  ServiceMessage message;
  message.client = reader.number<std::uint64_t>();
  message.sequence_number = reader.number<std::int64_t>();
  message.body = std::string(cdr.substr(0, kHeader)).append(cdr.substr(kHeader + kIdentity));
  return message;
}

std::string write_service_message(const ServiceMessage& message) {
  messages::CdrWriter writer;
  writer.number(message.client).number(message.sequence_number);
  return writer.bytes() + message.body.substr(kHeader);
}

}  // namespace tileflight::ros2
