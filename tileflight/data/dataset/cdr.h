#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>

namespace tileflight::dataset {

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

}  // namespace tileflight::dataset
