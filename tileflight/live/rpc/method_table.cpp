#include "tileflight/live/rpc/method_table.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <new>

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

/// Bytes that declare an array. MessagePack specification, "array format family".
std::size_t array_header_bytes(char first) {
  constexpr std::uint8_t kArray16 = 0xdc, kArray32 = 0xdd;
  const auto byte = static_cast<std::uint8_t>(first);
  return byte == kArray16 ? 3 : byte == kArray32 ? 5 : 1;
}

}  // namespace

std::string method_of(const std::string& message) {
  constexpr int kNamePosition = 2;  // at most: after kind and id
  try {
    std::size_t offset = message.empty() ? 0 : array_header_bytes(message.front());
    for (int i = 0; i <= kNamePosition && offset < message.size(); ++i) {
      const msgpack::object_handle value = msgpack::unpack(message.data(), message.size(), offset, keep_in_message);
      if (value->type != msgpack::type::POSITIVE_INTEGER) return text(value.get());
    }
  } catch (const msgpack::unpack_error&) {
  } catch (const ProtocolError&) {  // Request names the fault
  }
  return {};
}

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

namespace {

constexpr std::size_t kMaxErrorLength = 2000;

void begin_answer(Encoder& out, std::uint32_t id) {
  out.array(4);
  out.unsigned_integer(1);
  out.unsigned_integer(id);
}

/// A name sent by a client, made safe for a log line.
std::string printable(const std::string& name) {
  std::string result = name.substr(0, 64);
  for (char& c : result) {
    if (c < ' ' || c > '~') c = '?';
  }
  return result;
}

std::string describe_call(const Request& request) {
  return "function '" + printable(request.method()) + "' (called with " + std::to_string(request.arguments().size()) +
         " arg(s)) threw an exception.";
}

std::string unknown_method_message(const Request& request) {
  return "rpclib: server could not find function '" + printable(request.method()) + "' with argument count " +
         std::to_string(request.arguments().size()) + ".";
}

std::string argument_count_message(const Request& request, std::size_t expected) {
  return "rpclib: client error C0002: Function '" + printable(request.method()) +
         "' was called with an invalid number of arguments. Expected: " + std::to_string(expected) +
         ", got: " + std::to_string(request.arguments().size());
}

std::string exception_message(const Request& request, const std::string& what) {
  return "rpclib: " + describe_call(request) + " The exception contained this information: " + what + ".";
}

}  // namespace

double steady_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

std::string encode_error(std::uint32_t id, const std::string& error) {
  Encoder out;
  begin_answer(out, id);
  out.text(error.substr(0, kMaxErrorLength));
  out.nil();
  return out.take();
}

void MethodTable::add_handler(const std::string& name, std::size_t arguments, Handler handler) {
  methods_[name].emplace_back(arguments, std::move(handler));
}

std::vector<std::string> MethodTable::names() const {
  std::vector<std::string> result;
  for (const auto& [name, handlers] : methods_) result.push_back(name);
  return result;
}

Response MethodTable::call(const Request& request) const {
  Response answer;
  const auto fail = [&](std::string error) {
    answer.failed = true;
    answer.bytes = encode_error(request.id(), error);
    answer.error = std::move(error);
    return answer;
  };
  const auto found = methods_.find(request.method());
  if (found == methods_.end()) return fail(unknown_method_message(request));
  const auto& handlers = found->second;
  const auto handler = std::ranges::find_if(handlers, [&](const auto& candidate) {
    return candidate.first == request.arguments().size() || candidate.first == kVariadic;
  });
  if (handler == handlers.end()) return fail(argument_count_message(request, handlers.front().first));
  try {
    Encoder out;
    begin_answer(out, request.id());
    out.nil();
    handler->second(request.arguments(), out, answer.seconds);
    answer.bytes = out.take();
    return answer;
  } catch (const std::bad_alloc&) {
    return fail(exception_message(request, "out of memory; request less at once"));
  } catch (const std::exception& fault) {
    return fail(exception_message(request, fault.what()));
  }
}

}  // namespace tileflight::rpc
