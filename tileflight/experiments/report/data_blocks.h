#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace tileflight::report {

/// Binary blocks of numbers with a header, for the page's view (read by web/src/data.ts): the header's length in bytes
/// as 32 bits, the header as JSON (UTF-8), blanks up to a multiple of four, and the blocks, each aligned to a multiple
/// of four from there. All numbers are little-endian.
class DataBlocks {
 public:
  /// Appends a block. Returns its position for the header: {"at", "bytes"}.
  template <class Number>
  nlohmann::json add(std::span<const Number> numbers) {
    return add_bytes({reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes()});
  }
  nlohmann::json add_bytes(std::string_view bytes);

  /// Header and blocks as one zlib stream (RFC 1950). Deterministic.
  std::string compress(const nlohmann::json& header) const;

 private:
  std::string bytes_;
};

}  // namespace tileflight::report
