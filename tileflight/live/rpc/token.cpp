#include "tileflight/live/rpc/token.h"

#include <cstdint>

namespace tileflight::rpc {

bool equal_in_constant_time(std::string_view presented, std::string_view right) {
  volatile std::uint8_t different = presented.size() == right.size() && !right.empty() ? 0 : 1;
  for (std::size_t i = 0; i < presented.size(); ++i) {
    const char other = right.empty() ? '\0' : right[i % right.size()];
    different = static_cast<std::uint8_t>(different | static_cast<std::uint8_t>(presented[i] ^ other));
  }
  return different == 0;
}

}  // namespace tileflight::rpc
