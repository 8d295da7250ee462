#pragma once

#include <cstddef>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>

namespace tileflight::report {

/// Blocks of numbers behind a header, for the page's view (web/src/data.ts reads them): the header's length in bytes as
/// 32 bits, the header as JSON (UTF-8), blanks up to a multiple of four, and the blocks, each begun at a multiple of
/// four from there. All numbers are little-endian.
class DataBlocks {
 public:
  /// Where the block lies, for the header: {"at", "bytes"}.
  template <class Number>
  nlohmann::json add(std::span<const Number> numbers) {
    return add_bytes({reinterpret_cast<const char*>(numbers.data()), numbers.size_bytes()});
  }
  nlohmann::json add_bytes(std::string_view bytes);

  std::size_t size_bytes() const { return bytes_.size(); }

  /// Header and blocks as one zlib stream (RFC 1950). The same input gives the same bytes.
  std::string deflated(const nlohmann::json& header) const;

 private:
  std::string bytes_;
};

}  // namespace tileflight::report
