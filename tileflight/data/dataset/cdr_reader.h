#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>

namespace tileflight::dataset {

/// Reads values in the order of a ROS 2 message that others sent: OMG's Common Data Representation, version 1, of
/// either byte order (CDR_BE, CDR_LE), as CdrWriter writes it. All reading throws InputError (`what`, the byte) at the
/// end of the bytes.
class CdrReader {
 public:
  /// `message` with its four-byte header; must outlive the reader. Throws InputError: no such header.
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

}  // namespace tileflight::dataset
