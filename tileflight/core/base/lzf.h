#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace tileflight::base {

/// Expands LibLZF's format, which PCD's binary_compressed uses, to exactly `size` bytes; nullopt when the input is
/// damaged or holds another number of bytes.
std::optional<std::string> lzf_decompress(std::string_view input, std::size_t size);

/// Throws InputError for 4 GB and more, which the LibLZF library cannot take.
std::string lzf_compress(std::string_view input);

}  // namespace tileflight::base
