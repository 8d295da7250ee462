#pragma once

#include <cstdint>
#include <msgpack.hpp>
#include <span>
#include <string>
#include <string_view>

namespace tileflight::rpc {

/// Writes MessagePack as AirSim's clients read it: floats as float32, bytes as bin, texts never as str8 (which clients
/// from before 2013's specification do not know) and always UTF-8, for clients that decode strictly.
class Encoder {
 public:
  void nil() { packer().pack_nil(); }
  void boolean(bool value) { value ? packer().pack_true() : packer().pack_false(); }
  void integer(std::int64_t value) { packer().pack_int64(value); }
  void natural(std::uint64_t value) { packer().pack_uint64(value); }
  /// Always a float32, also of a whole number, which the library would write as one.
  void real(float value);
  /// Always a float64.
  void real64(double value);
  void array(std::size_t values) { packer().pack_array(count(values)); }
  void map(std::size_t entries) { packer().pack_map(count(entries)); }
  /// A byte that is not UTF-8 becomes '?'.
  void text(std::string_view value);
  void blob(std::span<const std::uint8_t> bytes);
  /// An array of float32.
  void reals(std::span<const float> values);

  const std::string& bytes() const { return buffer_.bytes; }
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

/// The text with each byte that does not belong to a UTF-8 character replaced by '?'.
std::string valid_utf8(std::string_view text);

}  // namespace tileflight::rpc
