#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace tileflight::messages {

/// Reads values in the order of a ROS 2 message that others sent: OMG's Common Data Representation, version 1, of
/// either byte order (CDR_BE, CDR_LE), as CdrWriter writes it. All reading throws InputError (`what`, the byte) at the
/// end of the bytes.
class CdrReader {
 public:
  /// Reads `message`, which begins with its four-byte header and must outlive the reader. Throws InputError: no such
  /// header.
  CdrReader(std::string_view message, std::string what);

  template <class Number>
  Number number() {
    char bytes[sizeof(Number)];
    take(sizeof bytes, sizeof bytes, bytes);
    Number value;
    std::memcpy(&value, bytes, sizeof value);
    return value;
  }
  /// A string; one that is longer than `max_bytes` is an error, and so is one without the zero at its end.
  std::string text(std::size_t max_bytes);

 private:
  /// Copies the next bytes after alignment, in the processor's order.
  void take(std::size_t size, std::size_t alignment, char* to);
  [[noreturn]] void fail(const std::string& cause) const;

  std::string_view body_;  ///< alignment counts from its begin
  std::string what_;
  std::size_t at_ = 0;
  bool is_swapped_ = false;
};

/// Serializes values in the order of a ROS 2 message: OMG's Common Data Representation, version 1, little-endian
/// (CDR_LE). Numbers are aligned to multiples of their size, counted from the end of the four-byte header.
class CdrWriter {
 public:
  template <class Number>
  CdrWriter& number(Number value) {
    static_assert(std::endian::native == std::endian::little);
    pad(sizeof value);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  CdrWriter& text(std::string_view value) {
    number(static_cast<std::uint32_t>(value.size() + 1));
    bytes_.append(value).push_back('\0');
    return *this;
  }
  /// uint8[]
  CdrWriter& blob(std::string_view bytes) {
    number(static_cast<std::uint32_t>(bytes.size()));
    bytes_.append(bytes);
    return *this;
  }
  /// An array of fixed length, e.g. float64[9].
  template <class Numbers>
  CdrWriter& array(const Numbers& numbers) {
    for (const auto value : numbers) number(value);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  static constexpr std::size_t kHeaderBytes = 4;

  void pad(std::size_t size) {
    while ((bytes_.size() - kHeaderBytes) % size != 0) bytes_.push_back('\0');
  }

  std::string bytes_ = std::string("\0\1\0\0", kHeaderBytes);
};

}  // namespace tileflight::messages
