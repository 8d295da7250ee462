#pragma once

#include <cstdint>
#include <msgpack.hpp>
#include <span>
#include <string>

namespace tileflight::rpc {

/// A call that came over the network, decoded. msgpack-rpc specification: `[0, id, method, [args…]]`, or a
/// notification, which is not answered: `[2, method, [args…]]`.
class Request {
 public:
  /// `message`: one whole message, as MessageScanner cuts it. Throws ProtocolError for what is no call.
  explicit Request(std::string message);

  bool wants_answer() const { return wants_answer_; }
  std::uint32_t id() const { return id_; }
  const std::string& method() const { return method_; }
  std::span<const msgpack::object> arguments() const { return arguments_; }

 private:
  std::string message_;  ///< texts and blobs of the arguments lie here
  msgpack::object_handle handle_;
  bool wants_answer_ = false;
  std::uint32_t id_ = 0;
  std::string method_;
  std::span<const msgpack::object> arguments_;
};

}  // namespace tileflight::rpc
