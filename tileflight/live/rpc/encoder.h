#pragma once

#include <cstdint>
#include <msgpack.hpp>
#include <span>
#include <string>
#include <string_view>

namespace tileflight::rpc {

/// Writes MessagePack for AirSim's clients: floats as float32, bytes as bin, strings never as str8 (unknown to clients
/// older than the 2013 specification) and always valid UTF-8, for clients that decode strictly.
class Encoder {
 public:
  void nil() { packer().pack_nil(); }
  void boolean(bool value) { value ? packer().pack_true() : packer().pack_false(); }
  void signed_integer(std::int64_t value) { packer().pack_int64(value); }
  void unsigned_integer(std::uint64_t value) { packer().pack_uint64(value); }
  /// Always a float32, even for an integer value, which the msgpack library would write as an integer.
  void float32(float value);
  /// Always a float64.
  void float64(double value);
  void array(std::size_t values) { packer().pack_array(count(values)); }
  void map(std::size_t entries) { packer().pack_map(count(entries)); }
  /// Bytes that are not valid UTF-8 become '?'.
  void text(std::string_view value);
  void binary(std::span<const std::uint8_t> bytes);
  /// An array of float32.
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

/// The text with each byte that is not part of a valid UTF-8 character replaced by '?'.
std::string sanitize_utf8(std::string_view text);

}  // namespace tileflight::rpc
