#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tileflight::geometry {

/// Expands LibLZF's format (M. Lehmann), which PCD's binary_compressed uses, to exactly `size` bytes; nullopt when the
/// input is damaged or holds another number of bytes.
///
/// The input is a row of tokens. A first byte c < 32: c + 1 literal bytes follow. Otherwise a copy of bytes already
/// written: length (c >> 5) + 2, where 7 in those three bits adds the next byte; distance ((c & 31) << 8 | next byte)
/// + 1.
std::optional<std::string> lzf_expanded(std::string_view input, std::size_t size);

/// The bytes as literal tokens and copies of at most 264 bytes (greedy, nearest match by a table of three-byte groups).
std::string lzf_compressed(std::string_view input);

}  // namespace tileflight::geometry
