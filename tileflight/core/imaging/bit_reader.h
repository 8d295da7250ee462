#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "tileflight/core/base/input_error.h"

namespace tileflight::imaging {

/// Reads bits from a byte stream, least significant bit of each byte first.
class BitReader {
 public:
  BitReader(std::span<const std::byte> bytes, const std::string& name) : bytes_(bytes), name_(name) {}

  /// Reads up to 24 bits. Throws InputError at the end of the stream.
  std::uint32_t read(unsigned count) {
    while (held_ < count) {
      if (next_ == bytes_.size()) throw InputError(name_, "its compressed data are truncated");
      bits_ |= std::to_integer<std::uint32_t>(bytes_[next_++]) << held_;
      held_ += 8;
    }
    const std::uint32_t value = bits_ & ((1U << count) - 1U);
    bits_ >>= count;
    held_ -= count;
    return value;
  }

  const std::string& name() const { return name_; }

 private:
  std::span<const std::byte> bytes_;
  std::string name_;
  std::size_t next_ = 0;
  std::uint32_t bits_ = 0;
  unsigned held_ = 0;
};

}  // namespace tileflight::imaging
