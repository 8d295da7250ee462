#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "tileflight/live/ros2/participant.h"

namespace tileflight::ros2 {

/// A request as rmw_cyclonedds_cpp sends it: 16 bytes that identify the request, then the message's fields. The 16
/// bytes keep the alignment of the fields.
struct ServiceMessage {
  std::uint64_t client = 0;
  std::int64_t sequence_number = 0;
  std::string body;  ///< CDR with its four-byte header, without those 16 bytes
};

/// Splits a message. Throws InputError (`what`, cause).
ServiceMessage read_service_message(std::string_view cdr, const std::string& what);
std::string write_service_message(const ServiceMessage& message);

/// A service for clients that run rmw_cyclonedds_cpp: requests and replies are messages of two topics that begin with a
/// client's number (64 bits) and the request's, which the reply repeats. Clients of other middlewares (rmw_fastrtps_cpp
/// sends both beside the message, as DDS-RPC's related sample identity) find the service, and get no answer; that is
/// reported.
class Service {
 public:
  /// Takes a request and returns the response, both CDR with its header. It is called in the service's own thread, one
  /// request after the other. An exception is reported, and there is no reply.
  using Handler = std::function<std::string(std::string_view request)>;

  /// `name` and `type` as in ROS 2 ("/drone/reset", "std_srvs/srv/Trigger"). Throws InputError.
  Service(Participant& participant, const std::string& name, const std::string& type, Handler handler);
  ~Service();
  Service(const Service&) = delete;
  Service& operator=(const Service&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tileflight::ros2
