#include "tileflight/data/messages/cdr.h"

#include <algorithm>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::messages {
namespace {

constexpr std::size_t kEncapsulationBytes = 4;

}  // namespace

CdrReader::CdrReader(std::string_view message, std::string what) : what_(std::move(what)) {
  static_assert(std::endian::native == std::endian::little);
  const bool is_cdr = message.size() >= kEncapsulationBytes && message[0] == 0 && (message[1] == 0 || message[1] == 1);
  if (!is_cdr) throw InputError(what_, "a message is not encoded in CDR");
  is_swapped_ = message[1] == 0;
  body_ = message.substr(kEncapsulationBytes);
}

std::string CdrReader::text(std::size_t max_bytes) {
  const auto size = number<std::uint32_t>();
  if (size > max_bytes + 1) fail("holds a text of " + std::to_string(size) + " bytes");
  if (size > body_.size() - at_) fail("is cut off");
  const std::string_view bytes = body_.substr(at_, size);
  at_ += size;
  if (bytes.empty() || bytes.back() != '\0') fail("holds a text without an end");
  return std::string(bytes.substr(0, size - 1));
}

void CdrReader::take(std::size_t size, std::size_t alignment, char* to) {
  const std::size_t begin = (at_ + alignment - 1) / alignment * alignment;
  if (begin > body_.size() || size > body_.size() - begin) fail("is cut off");
  std::copy_n(body_.data() + begin, size, to);
  if (is_swapped_) std::reverse(to, to + size);
  at_ = begin + size;
}

void CdrReader::fail(const std::string& cause) const {
  throw InputError(what_, "a message " + cause + " (byte " + std::to_string(at_ + kEncapsulationBytes) + ")");
}

}  // namespace tileflight::messages
