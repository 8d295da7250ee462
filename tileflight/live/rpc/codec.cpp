#include "tileflight/live/rpc/codec.h"

#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace tileflight::rpc {
namespace {

bool is_continuation_byte(std::string_view text, std::size_t i) {
  return i < text.size() && (static_cast<std::uint8_t>(text[i]) & 0xc0U) == 0x80U;
}

/// Length in bytes of the character at `i`, 0 if none starts there (RFC 3629, section 4).
std::size_t character_bytes(std::string_view text, std::size_t i) {
  const auto a = static_cast<std::uint8_t>(text[i]);
  if (a < 0x80) return 1;
  if (!is_continuation_byte(text, i + 1)) return 0;
  const auto b = static_cast<std::uint8_t>(text[i + 1]);
  if (a >= 0xc2 && a <= 0xdf) return 2;
  if (!is_continuation_byte(text, i + 2)) return 0;
  if (a >= 0xe0 && a <= 0xef) return (a == 0xe0 && b < 0xa0) || (a == 0xed && b > 0x9f) ? 0 : 3;
  if (!is_continuation_byte(text, i + 3)) return 0;
  if (a >= 0xf0 && a <= 0xf4) return (a == 0xf0 && b < 0x90) || (a == 0xf4 && b > 0x8f) ? 0 : 4;
  return 0;
}

/// Number of leading bytes that are valid UTF-8.
std::size_t valid_prefix(std::string_view text) {
  std::size_t i = 0;
  while (i < text.size()) {
    const std::size_t bytes = character_bytes(text, i);
    if (bytes == 0) break;
    i += bytes;
  }
  return i;
}

/// Writes five bytes: the format byte and the number, big-endian.
void put_real(float value, char* out) {
  const auto bits = std::bit_cast<std::uint32_t>(value);
  out[0] = static_cast<char>(0xca);
  out[1] = static_cast<char>(bits >> 24U);
  out[2] = static_cast<char>(bits >> 16U);
  out[3] = static_cast<char>(bits >> 8U);
  out[4] = static_cast<char>(bits);
}

}  // namespace

std::string sanitize_utf8(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const std::size_t valid = valid_prefix(text);
    result.append(text.substr(0, valid));
    if (valid < text.size()) result += '?';
    text.remove_prefix(std::min(text.size(), valid + 1));
  }
  return result;
}

std::uint32_t Encoder::count(std::size_t values) {
  if (values > std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error("the answer has more than 4 G values; request less at once");
  }
  return static_cast<std::uint32_t>(values);
}

void Encoder::float32(float value) {
  std::array<char, 5> bytes;
  put_real(value, bytes.data());
  buffer_.write(bytes.data(), bytes.size());
}

void Encoder::float64(double value) {
  const auto bits = std::bit_cast<std::uint64_t>(value);
  std::array<char, 9> bytes{static_cast<char>(0xcb)};
  for (std::size_t i = 1; i < 9; ++i) bytes[i] = static_cast<char>(bits >> (64U - 8U * i));
  buffer_.write(bytes.data(), bytes.size());
}

void Encoder::text(std::string_view value) {
  if (valid_prefix(value) != value.size()) return text(sanitize_utf8(value));
  const std::uint32_t size = count(value.size());
  if (size < 32 || size > 255) {
    packer().pack_str(size);
  } else {
    const std::array<char, 3> str16{static_cast<char>(0xda), 0, static_cast<char>(size)};
    buffer_.write(str16.data(), str16.size());
  }
  buffer_.write(value.data(), value.size());
}

void Encoder::binary(std::span<const std::uint8_t> bytes) {
  packer().pack_bin(count(bytes.size()));
  buffer_.write(reinterpret_cast<const char*>(bytes.data()), bytes.size());
}

void Encoder::float32_array(std::span<const float> values) {
  array(values.size());
  buffer_.bytes.reserve(buffer_.bytes.size() + 5 * values.size());
  std::array<char, 5 * 512> block;
  while (!values.empty()) {
    const std::size_t n = std::min<std::size_t>(values.size(), 512);
    for (std::size_t i = 0; i < n; ++i) put_real(values[i], &block[5 * i]);
    buffer_.write(block.data(), 5 * n);
    values = values.subspan(n);
  }
}

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
