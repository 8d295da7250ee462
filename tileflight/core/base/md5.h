#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace tileflight::base {

/// MD5 (RFC 1321), used by the index of a .3tz to name its files. Not for security.
std::array<std::uint8_t, 16> md5(std::string_view bytes);

}  // namespace tileflight::base
