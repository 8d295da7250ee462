#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image.h"

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

/// A canonical Huffman code (RFC 1951, section 3.2.2), as stored by BasisLZ (KTX2, "Compressed Huffman Tables").
class HuffmanTable {
 public:
  HuffmanTable() = default;
  /// Makes a table from the code lengths of the symbols, 0 to 16 bits. Throws InputError if they do not form a valid
  /// code.
  HuffmanTable(const std::vector<std::uint8_t>& lengths, const std::string& name);

  static HuffmanTable read(BitReader& bits);

  std::uint32_t decode(BitReader& bits) const;

 private:
  static constexpr std::size_t kMaxCodeBits = 16;
  std::array<std::uint32_t, kMaxCodeBits + 1> counts_{};  ///< number of codes of each length
  std::vector<std::uint16_t> symbols_;                    ///< in order of their codes
};

/// Codebooks shared by all slices of a BasisLZ texture (KTX2, appendix "BasisLZ/ETC1S Bitstream Specification").
class Etc1sCodebooks {
 public:
  /// Reads the codebooks. Throws InputError.
  Etc1sCodebooks(std::size_t endpoint_count, std::span<const std::byte> endpoints, std::size_t selector_count,
                 std::span<const std::byte> selectors, std::span<const std::byte> tables, const std::string& name);

  /// Decodes one slice of a still image (not video). Throws InputError.
  RgbImage decode_slice(std::span<const std::byte> slice, int width, int height, const std::string& name) const;

 private:
  struct Endpoint {
    std::array<std::uint8_t, 3> color;  ///< five bits each
    std::uint8_t intensity;             ///< row of the modifier table
  };
  using Selector = std::array<std::uint8_t, 4>;  ///< rows of four texels, two bits a texel, leftmost in the lowest bits

  class SliceDecoder;

  void read_endpoints(std::size_t count, BitReader bits);
  void read_selectors(std::size_t count, BitReader bits);
  void paint_block(std::size_t block_x, std::size_t block_y, const Endpoint& endpoint, const Selector& selector,
                   RgbImage& image) const;

  std::vector<Endpoint> endpoints_;
  std::vector<Selector> selectors_;
  HuffmanTable endpoint_prediction_, endpoint_delta_, selector_, selector_run_;
  std::size_t history_size_ = 0;
};

}  // namespace tileflight::imaging
