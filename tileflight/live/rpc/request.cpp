#include "tileflight/live/rpc/request.h"

#include <limits>

#include "tileflight/live/rpc/message_scanner.h"

namespace tileflight::rpc {
namespace {

constexpr std::uint64_t kRequest = 0;
constexpr std::uint64_t kNotification = 2;

std::uint64_t whole_number(const msgpack::object& value, const char* what) {
  if (value.type != msgpack::type::POSITIVE_INTEGER) throw ProtocolError(std::string(what) + " is not an integer");
  return value.via.u64;
}

std::string text(const msgpack::object& value) {
  if (value.type == msgpack::type::STR) return {value.via.str.ptr, value.via.str.size};
  if (value.type == msgpack::type::BIN) return {value.via.bin.ptr, value.via.bin.size};
  throw ProtocolError("a method name is not a string");
}

/// Strings and blobs refer to the message instead of being copied.
bool keep_in_message(msgpack::type::object_type, std::size_t, void*) { return true; }

msgpack::object_handle unpack_message(const std::string& message) {
  try {
    return msgpack::unpack(message.data(), message.size(), keep_in_message);
  } catch (const msgpack::unpack_error& fault) {
    throw ProtocolError(std::string("bytes that are not MessagePack: ") + fault.what());
  }
}

}  // namespace

Request::Request(std::string message) : message_(std::move(message)), handle_(unpack_message(message_)) {
  const msgpack::object& root = handle_.get();
  if (root.type != msgpack::type::ARRAY || root.via.array.size < 3) throw ProtocolError("a message is not an array");
  const std::span<const msgpack::object> values(root.via.array.ptr, root.via.array.size);
  const std::uint64_t kind = whole_number(values[0], "a message's kind");
  expects_response_ = kind == kRequest && values.size() == 4;
  if (!expects_response_ && !(kind == kNotification && values.size() == 3)) {
    throw ProtocolError("a message that is neither a request nor a notification");
  }
  if (expects_response_) {
    const std::uint64_t id = whole_number(values[1], "a request's id");
    if (id > std::numeric_limits<std::uint32_t>::max()) throw ProtocolError("a request's id is beyond 32 bits");
    id_ = static_cast<std::uint32_t>(id);
  }
  const std::size_t at = expects_response_ ? 2 : 1;
  method_ = text(values[at]);
  if (values[at + 1].type != msgpack::type::ARRAY) throw ProtocolError("the arguments of a method are not an array");
  arguments_ = {values[at + 1].via.array.ptr, values[at + 1].via.array.size};
}

}  // namespace tileflight::rpc
