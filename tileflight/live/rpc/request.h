#pragma once

#include <cstdint>
#include <msgpack.hpp>
#include <span>
#include <string>

namespace tileflight::rpc {

/// A decoded call. msgpack-rpc specification: `[0, id, method, [args…]]`, or a notification, which gets no response:
/// `[2, method, [args…]]`.
class Request {
 public:
  /// `message`: one whole message, as delimited by MessageScanner. Throws ProtocolError if it is not a call.
  explicit Request(std::string message);

  /// The message as it came.
  const std::string& message() const { return message_; }
  bool expects_response() const { return expects_response_; }
  std::uint32_t id() const { return id_; }
  const std::string& method() const { return method_; }
  std::span<const msgpack::object> arguments() const { return arguments_; }

 private:
  std::string message_;  ///< storage for strings and blobs of the arguments
  msgpack::object_handle handle_;
  bool expects_response_ = false;
  std::uint32_t id_ = 0;
  std::string method_;
  std::span<const msgpack::object> arguments_;
};

}  // namespace tileflight::rpc
