#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace tileflight::tiles {

/// MD5 (RFC 1321), by which the index of a .3tz names its files. Not for anything that has to be safe.
std::array<std::uint8_t, 16> md5(std::string_view bytes);

}  // namespace tileflight::tiles
