#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <msgpack.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <vector>

namespace tileflight::rpc {

/// Writes MessagePack for AirSim's clients: floats as float32, bytes as bin, strings never as str8 (unknown to clients
/// older than the 2013 specification) and always valid UTF-8, for clients that decode strictly.
class Encoder {
 public:
  void nil() { packer().pack_nil(); }
  void boolean(bool value) { value ? packer().pack_true() : packer().pack_false(); }
  void signed_integer(std::int64_t value) { packer().pack_int64(value); }
  void unsigned_integer(std::uint64_t value) { packer().pack_uint64(value); }
  /// Writes a float32 even for an integer value, which the msgpack library would write as an integer.
  void float32(float value);
  /// Writes a float64.
  void float64(double value);
  void array(std::size_t values) { packer().pack_array(count(values)); }
  void map(std::size_t entries) { packer().pack_map(count(entries)); }
  /// Writes a string in which bytes that are not valid UTF-8 become '?'.
  void text(std::string_view value);
  void binary(std::span<const std::uint8_t> bytes);
  /// Writes an array of float32.
  void float32_array(std::span<const float> values);

  std::string take() { return std::move(buffer_.bytes); }

 private:
  struct Buffer {
    std::string bytes;
    void write(const char* data, std::size_t size) { bytes.append(data, size); }
  };
  msgpack::packer<Buffer> packer() { return msgpack::packer<Buffer>(buffer_); }
  static std::uint32_t count(std::size_t values);

  Buffer buffer_;
};

/// Replaces each byte that is not part of a valid UTF-8 character by '?'.
std::string sanitize_utf8(std::string_view text);

/// An argument of the wrong type. The message is a phrase that states the expected type, for use in an error line.
class DecodeError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Returns the type of a value in words, with its article.
const char* describe_type(const msgpack::object& value);

/// Maps a structure to a message: a map keyed by field names. Specialisations, which TILEFLIGHT_RPC_FIELDS makes, have
/// a `list`: a tuple of fields in packing order.
template <class T>
struct Fields;

template <class T, class Member>
struct Field {
  const char* name;
  Member T::*member;
};

template <class T, class Member>
constexpr Field<T, Member> field(const char* name, Member T::*member) {
  return {name, member};
}

// TILEFLIGHT_RPC_FIELDS(Structure, member, ...): each of these members under its own name. The list is expanded one
// member at a time, for at most 64.
#define TILEFLIGHT_RPC_FIELDS(Structure, ...)                                                       \
  template <>                                                                                       \
  struct Fields<Structure> {                                                                        \
    using T = Structure;                                                                            \
    static constexpr auto list = std::tuple(TILEFLIGHT_EXPAND(TILEFLIGHT_NEXT_FIELD(__VA_ARGS__))); \
  }
#define TILEFLIGHT_NEXT_FIELD(member, ...) \
  field(#member, &T::member) __VA_OPT__(, TILEFLIGHT_FIELD_AGAIN TILEFLIGHT_PARENTHESES(__VA_ARGS__))
#define TILEFLIGHT_FIELD_AGAIN() TILEFLIGHT_NEXT_FIELD
#define TILEFLIGHT_PARENTHESES ()
#define TILEFLIGHT_EXPAND(...) \
  TILEFLIGHT_EXPAND_16(TILEFLIGHT_EXPAND_16(TILEFLIGHT_EXPAND_16(TILEFLIGHT_EXPAND_16(__VA_ARGS__))))
#define TILEFLIGHT_EXPAND_16(...) \
  TILEFLIGHT_EXPAND_4(TILEFLIGHT_EXPAND_4(TILEFLIGHT_EXPAND_4(TILEFLIGHT_EXPAND_4(__VA_ARGS__))))
#define TILEFLIGHT_EXPAND_4(...) \
  TILEFLIGHT_EXPAND_1(TILEFLIGHT_EXPAND_1(TILEFLIGHT_EXPAND_1(TILEFLIGHT_EXPAND_1(__VA_ARGS__))))
#define TILEFLIGHT_EXPAND_1(...) __VA_ARGS__

template <class T>
concept Structure = requires {
  Fields<T>::list;
};

// encode() writes a C++ value. decode() reads one; throws DecodeError.

template <class T>
requires std::is_integral_v<T>
void encode(Encoder& out, T value) {
  if constexpr (std::is_same_v<T, bool>) {
    out.boolean(value);
  } else if constexpr (std::is_signed_v<T>) {
    out.signed_integer(value);
  } else {
    out.unsigned_integer(value);
  }
}
template <class T>
requires std::is_enum_v<T>
void encode(Encoder& out, T value) { encode(out, static_cast<std::underlying_type_t<T>>(value)); }
inline void encode(Encoder& out, float value) { out.float32(value); }
inline void encode(Encoder& out, double value) { out.float64(value); }
inline void encode(Encoder& out, const std::string& value) { out.text(value); }
inline void encode(Encoder& out, const std::vector<std::uint8_t>& value) { out.binary(value); }
inline void encode(Encoder& out, const std::vector<float>& value) { out.float32_array(value); }
template <class T, std::size_t N>
void encode(Encoder& out, const std::array<T, N>& values);
template <class T>
void encode(Encoder& out, const std::vector<T>& values);
template <class T>
void encode(Encoder& out, const std::map<std::string, T>& values);
template <Structure T>
void encode(Encoder& out, const T& value);

void decode(const msgpack::object& value, bool& result);
void decode(const msgpack::object& value, float& result);
void decode(const msgpack::object& value, double& result);
void decode(const msgpack::object& value, std::string& result);
void decode(const msgpack::object& value, std::vector<std::uint8_t>& result);
/// Reads any integer as 64 bits; `negative` tells whether it is below zero.
std::uint64_t decode_integer(const msgpack::object& value, bool& negative);
template <class T>
requires(std::is_integral_v<T> && !std::is_same_v<T, bool>) void decode(const msgpack::object& value, T& result);
template <class T>
requires std::is_enum_v<T>
void decode(const msgpack::object& value, T& result);
template <class T, std::size_t N>
void decode(const msgpack::object& value, std::array<T, N>& result);
template <class T>
void decode(const msgpack::object& value, std::vector<T>& result);
template <Structure T>
void decode(const msgpack::object& value, T& result);

template <class T, std::size_t N>
void encode(Encoder& out, const std::array<T, N>& values) {
  out.array(N);
  for (const T& value : values) encode(out, value);
}

template <class T>
void encode(Encoder& out, const std::vector<T>& values) {
  out.array(values.size());
  for (const T& value : values) encode(out, value);
}

template <class T>
void encode(Encoder& out, const std::map<std::string, T>& values) {
  out.map(values.size());
  for (const auto& [name, value] : values) {
    out.text(name);
    encode(out, value);
  }
}

template <Structure T>
void encode(Encoder& out, const T& value) {
  std::apply(
      [&](const auto&... fields) {
        out.map(sizeof...(fields));
        ((out.text(fields.name), encode(out, value.*(fields.member))), ...);
      },
      Fields<T>::list);
}

template <class T>
requires(std::is_integral_v<T> && !std::is_same_v<T, bool>) void decode(const msgpack::object& value, T& result) {
  bool negative = false;
  const std::uint64_t bits = decode_integer(value, negative);
  const bool fits = negative ? std::is_signed_v<T> && static_cast<std::int64_t>(bits) >=
                                                          static_cast<std::int64_t>(std::numeric_limits<T>::min())
                             : bits <= static_cast<std::uint64_t>(std::numeric_limits<T>::max());
  if (!fits)
    throw DecodeError("expected an integer from " + std::to_string(std::numeric_limits<T>::min()) + " to " +
                      std::to_string(std::numeric_limits<T>::max()));
  result = static_cast<T>(bits);
}

template <class T>
requires std::is_enum_v<T>
void decode(const msgpack::object& value, T& result) {
  std::underlying_type_t<T> number{};
  decode(value, number);
  result = static_cast<T>(number);
}

template <class T>
void decode_element(const msgpack::object_array& values, std::uint32_t i, T& result) {
  try {
    decode(values.ptr[i], result);
  } catch (const DecodeError& fault) {
    throw DecodeError("element " + std::to_string(i) + ": " + fault.what());
  }
}

template <class T, std::size_t N>
void decode(const msgpack::object& value, std::array<T, N>& result) {
  if (value.type != msgpack::type::ARRAY || value.via.array.size != N) {
    throw DecodeError("expected an array of " + std::to_string(N) + " values, got " + describe_type(value));
  }
  for (std::uint32_t i = 0; i < N; ++i) decode_element(value.via.array, i, result[i]);
}

template <class T>
void decode(const msgpack::object& value, std::vector<T>& result) {
  static_assert(!std::is_same_v<T, bool>);
  if (value.type != msgpack::type::ARRAY)
    throw DecodeError(std::string("expected an array, got ") + describe_type(value));
  result.clear();
  for (std::uint32_t i = 0; i < value.via.array.size; ++i) decode_element(value.via.array, i, result.emplace_back());
}

/// Returns the value under `name`, the last one if the name occurs twice; nullptr if there is none.
const msgpack::object* find_key(const msgpack::object_map& map, std::string_view name);

/// Reads a structure from a map. Missing fields keep their default; unknown names are ignored.
template <Structure T>
void decode(const msgpack::object& value, T& result) {
  if (value.type != msgpack::type::MAP) throw DecodeError(std::string("expected a map, got ") + describe_type(value));
  const auto read = [&](const auto& field) {
    const msgpack::object* found = find_key(value.via.map, field.name);
    if (found == nullptr) return;
    try {
      decode(*found, result.*(field.member));
    } catch (const DecodeError& fault) {
      throw DecodeError(std::string(field.name) + ": " + fault.what());
    }
  };
  std::apply([&](const auto&... fields) { (read(fields), ...); }, Fields<T>::list);
}

}  // namespace tileflight::rpc
