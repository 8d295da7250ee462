#pragma once

#include <array>
#include <cstdint>
#include <string>

namespace tileflight::imaging::test_support {

/// Writes bits, least significant bit of each byte first; Huffman codes most significant bit first.
class BitWriter {
 public:
  void number(std::uint32_t value, unsigned count) {
    for (unsigned i = 0; i < count; ++i) bit(value >> i & 1U);
  }
  void code(std::uint32_t value, unsigned count) {
    for (unsigned i = count; i-- > 0;) bit(value >> i & 1U);
  }
  /// A table of `symbols` codes of equal length, so that the code of a symbol is its number.
  void flat_table(std::uint32_t symbols, unsigned length) {
    number(symbols, 14);
    number(21, 5);
    for (const unsigned symbol : kLengthOrder) number(symbol == length ? 1 : 0, 3);
    for (std::uint32_t i = 0; i < symbols; ++i) bit(0);
  }
  const std::string& bytes() const { return bytes_; }

  /// Order in which BasisLZ stores the lengths of the code-length codes.
  static constexpr std::array<unsigned, 21> kLengthOrder = {17, 18, 19, 20, 0,  8, 7,  9, 6,  10, 5,
                                                            11, 4,  12, 3,  13, 2, 14, 1, 15, 16};

 private:
  void bit(std::uint32_t value) {
    if (used_ % 8 == 0) bytes_ += '\0';
    bytes_.back() = static_cast<char>(static_cast<unsigned char>(bytes_.back()) | value << (used_ % 8));
    ++used_;
  }

  std::string bytes_;
  unsigned used_ = 0;
};

}  // namespace tileflight::imaging::test_support
