#include "tileflight/live/rpc/codec.h"

#include <cmath>

namespace tileflight::rpc {
namespace {

[[noreturn]] void throw_type_error(const char* due, const msgpack::object& value) {
  throw DecodeError("expected " + std::string(due) + ", got " + describe_type(value));
}

bool is_text(const msgpack::object& value) {
  return value.type == msgpack::type::STR || value.type == msgpack::type::BIN;
}

std::string_view to_bytes(const msgpack::object& value) {
  return value.type == msgpack::type::STR ? std::string_view(value.via.str.ptr, value.via.str.size)
                                          : std::string_view(value.via.bin.ptr, value.via.bin.size);
}

}  // namespace

const char* describe_type(const msgpack::object& value) {
  switch (value.type) {
    case msgpack::type::NIL:
      return "nil";
    case msgpack::type::BOOLEAN:
      return "a boolean";
    case msgpack::type::POSITIVE_INTEGER:
    case msgpack::type::NEGATIVE_INTEGER:
      return "an integer";
    case msgpack::type::FLOAT32:
    case msgpack::type::FLOAT64:
      return "a float";
    case msgpack::type::STR:
      return "a string";
    case msgpack::type::BIN:
      return "bytes";
    case msgpack::type::ARRAY:
      return "an array";
    case msgpack::type::MAP:
      return "a map";
    case msgpack::type::EXT:
      return "an extension";
  }
  return "something unknown";
}

void decode(const msgpack::object& value, bool& result) {
  if (value.type != msgpack::type::BOOLEAN) throw_type_error("a boolean", value);
  result = value.via.boolean;
}

void decode(const msgpack::object& value, double& result) {
  switch (value.type) {
    case msgpack::type::POSITIVE_INTEGER:
      result = static_cast<double>(value.via.u64);
      return;
    case msgpack::type::NEGATIVE_INTEGER:
      result = static_cast<double>(value.via.i64);
      return;
    case msgpack::type::FLOAT32:
    case msgpack::type::FLOAT64:
      result = value.via.f64;
      return;
    default:
      throw_type_error("a number", value);
  }
}

void decode(const msgpack::object& value, float& result) {
  double number = 0.0;
  decode(value, number);
  constexpr double kLargest = std::numeric_limits<float>::max();
  const bool beyond = std::abs(number) > kLargest;  // conversion of an out-of-range value is undefined
  result = beyond
               ? std::copysign(std::numeric_limits<float>::infinity(), static_cast<float>(std::copysign(1.0, number)))
               : static_cast<float>(number);
}

void decode(const msgpack::object& value, std::string& result) {
  if (!is_text(value)) throw_type_error("a string", value);
  result = to_bytes(value);
}

void decode(const msgpack::object& value, std::vector<std::uint8_t>& result) {
  if (!is_text(value)) throw_type_error("bytes", value);
  const std::string_view bytes = to_bytes(value);
  result.assign(bytes.begin(), bytes.end());
}

std::uint64_t decode_integer(const msgpack::object& value, bool& negative) {
  negative = value.type == msgpack::type::NEGATIVE_INTEGER;
  if (!negative && value.type != msgpack::type::POSITIVE_INTEGER) throw_type_error("an integer", value);
  return negative ? static_cast<std::uint64_t>(value.via.i64) : value.via.u64;
}

const msgpack::object* find_key(const msgpack::object_map& map, std::string_view name) {
  const msgpack::object* found = nullptr;
  for (std::uint32_t i = 0; i < map.size; ++i) {
    const msgpack::object& key = map.ptr[i].key;
    if (is_text(key) && to_bytes(key) == name) found = &map.ptr[i].val;
  }
  return found;
}

}  // namespace tileflight::rpc
